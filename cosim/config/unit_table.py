"""The units of quantities, in pint's language, with pint's names and values.

pint takes 0.13 s to read its own thousand units, of which the kinds of quantities accept these. All
others are refused in any case, so little else changes: `fm` is a femtometre and not a fermi, and a
few names of pint's other units, such as `yd`, are now those of these units with a prefix.
"""

from __future__ import annotations

UNITS = """
quecto- = 1e-30 = q-
ronto- = 1e-27 = r-
yocto- = 1e-24 = y-
zepto- = 1e-21 = z-
atto- = 1e-18 = a-
femto- = 1e-15 = f-
pico- = 1e-12 = p-
nano- = 1e-9 = n-
micro- = 1e-6 = \u00b5- = \u03bc- = u- = mu- = mc-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
deca- = 1e+1 = da- = deka-
hecto- = 1e2 = h-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
tera- = 1e12 = T-
peta- = 1e15 = P-
exa- = 1e18 = E-
zetta- = 1e21 = Z-
yotta- = 1e24 = Y-
ronna- = 1e27 = R-
quetta- = 1e30 = Q-
kibi- = 2**10 = Ki-
mebi- = 2**20 = Mi-
gibi- = 2**30 = Gi-
tebi- = 2**40 = Ti-
pebi- = 2**50 = Pi-
exbi- = 2**60 = Ei-
zebi- = 2**70 = Zi-
yobi- = 2**80 = Yi-
semi- = 0.5 = _ = demi-
sesqui- = 1.5
meter = [length] = m = metre
second = [time] = s = sec
ampere = [current] = A = amp
candela = [luminosity] = cd = candle
gram = [mass] = g
kelvin = [temperature]; offset: 0 = K = degK = \u00b0K = degree_Kelvin = degreeK
radian = [] = rad
bit = []
css_pixel = 0.0254 * meter / 96 = px
minute = 60 * second = min
hour = 60 * minute = h = hr
day = 24 * hour = d
degree = 3.141592653589793 / 180 * radian = deg = arcdeg = arcdegree = angular_degree
steradian = radian ** 2 = sr
hertz = 1 / second = Hz
newton = kilogram * meter / second ** 2 = N
joule = newton * meter = J
watt = joule / second = W
pascal = newton / meter ** 2 = Pa
bar = 1e5 * pascal
standard_atmosphere = 1.01325e5 * pascal = atm = atmosphere
torr = atm / 760
degree_Celsius = kelvin; offset: 273.15 = \u00b0C = celsius = degC = degreeC
lumen = candela * steradian = lm
lux = lumen / meter ** 2 = lx
coulomb = ampere * second = C
elementary_charge = 1.602176634e-19 * coulomb = e
volt = joule / coulomb = V
ohm = volt / ampere = \u03a9
farad = coulomb / volt = F
"""
