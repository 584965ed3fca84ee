"""Terms that are not everyday: a definition of each, and its mark at the first use in a section."""

from __future__ import annotations

import html
import re
from collections.abc import Collection
from typing import Final

TERMS: Final[dict[str, str]] = {
    "AprilTag": "A printed square pattern that a camera finds and identifies; four of them mark "
    "the corners of a panel.",
    "bound": "The most that leaving an effect out can change, computed before the run.",
    "charge threshold": "The charge, in electrons, at which a pixel fires a spike and starts anew.",
    "closed form": "A formula that gives the result without a simulation.",
    "confidence interval": "A range that holds the true value with the stated probability.",
    "contrast to noise": "Difference of two regions over the noise of a pixel, times the root of "
    "the number of pixels; below 5 an eye does not recognise the pattern (Rose, 1948).",
    "cross-talk": "The share of light or charge that ends up in a neighbouring pixel.",
    "cycle model": "A program that computes what a digital circuit does at every edge of its "
    "clock.",
    "dark current": "Electrons that a pixel collects without light, from heat.",
    "dead time": "The time after a spike during which a pixel collects nothing.",
    "DN": "Digital number: one step of the converter that reads a pixel.",
    "DSNU": "Dark signal non-uniformity: how much dark current differs from pixel to pixel.",
    "dynamic range": "The brightest light over the dimmest that are seen at once, in dB: 20 times "
    "the decimal logarithm of the ratio.",
    "EBAPS": "Electron-bombarded active pixel sensor: a field accelerates photoelectrons onto "
    "the pixels, which multiplies them.",
    "EBET": "Extended blurred edge time: how long a moving edge is blurred on the retina of an eye "
    "that follows it; smaller is sharper.",
    "effect": "One physical cause that changes what the machine does, such as shot noise; each is "
    "simulated or left out on its own.",
    "EMCCD": "Electron-multiplying CCD: a register multiplies the electrons before they are read.",
    "excess noise": "The noise that electron multiplication adds; its squared factor is 2 at high "
    "gain.",
    "exitance": "Light that leaves a surface, per area.",
    "eye diagram": "All received symbols drawn over one another; the more open it is, the fewer "
    "bits are decided wrongly.",
    "fill factor": "The share of a pixel's area that collects light.",
    "fixed pattern": "Differences between pixels that stay the same from image to image.",
    "FPN": "Fixed-pattern noise: differences between pixels that stay from image to image.",
    "full physics": "The same machine with every effect, in the most exact arithmetic.",
    "full scale": "The largest value that a pixel or a panel can express.",
    "full well": "The most electrons that a pixel can hold.",
    "goodput": "The rate at which bytes of the file itself arrive, verified, all overhead counted.",
    "ISI": "Inter-spike interval: the time between two spikes of a pixel; the brighter the light, "
    "the shorter.",
    "JOD": "Just-objectionable difference of ColorVideoVDP: 10 is no visible difference.",
    "latch": "To sample all pixels at an instant of the clock: which fired since the last one.",
    "line code": "Rules that turn data bits into bits that suit the light, such as as many on as "
    "off.",
    "on-off keying": "A cell of the panel is bright for a 1 and dark for a 0.",
    "patch": "A small square of pixels that is simulated twice, as in this run and with full "
    "physics, to measure the error.",
    "photon transfer": "Variance of a pixel's value against its mean, which tells its gain and "
    "noise.",
    "PRBS": "Pseudo-random bit sequence: bits that look random but can be computed, so that "
    "every wrong one is found.",
    "PRNU": "Photo-response non-uniformity: how much the sensitivity differs from pixel to pixel.",
    "PSF": "Point spread function: the blur that a lens makes of a point of light.",
    "PSNR": "Peak signal-to-noise ratio against the true image, in dB: 20 is visibly noisy, 30 is "
    "good, above 40 hardly differs.",
    "PstLM": "Short-term visibility of flicker of a lamp; 1 is just visible to half of the people.",
    "quantum efficiency": "The share of photons that free an electron.",
    "raw bit error rate": "The share of bits that are decided wrongly before any code mends them.",
    "Reed-Solomon": "An error-correcting code: it adds bytes from which wrong ones are mended.",
    "RMS": "Root mean square: the typical size of values that may be positive or negative.",
    "rolling shutter": "The rows of an image are exposed one after another.",
    "shot noise": "Light arrives as single photons, at random; so does the charge that they free.",
    "soft value": "How surely a bit was received: its sign is the bit, its size the certainty.",
    "spike": "One bit of a pixel: it has collected its threshold of charge once more.",
    "sRGB curve": "The brightness curve of screens (IEC 61966-2-1).",
    "SSIM": "Structural similarity to the true image: 1 is equal.",
    "SVM": "Stroboscopic visibility measure of flicker; 1 is just visible.",
    "TFI": "Texture from interval: the light at an instant is one over the interval between the "
    "spikes around it; sharp in motion, but noisy.",
    "TFP": "Texture from playback: the light at an instant is the share of cycles with a spike in "
    "a window around it; low in noise, but moving things blur.",
    "tick": "One period of the clock.",
    "tier": "A way to compute a pixel: fast, exact, or the reference, each measured against the "
    "next.",
    "tile": "A square of 16 x 16 pixels; what is simulated is decided for each.",
    "tolerance": "The largest error of the simulation that the scenario accepts; a larger one "
    "makes the run faster.",
}
"""Definition of each term, as it is written in a text; an initial capital and a plural count as
the same term."""

_SILENT: Final = frozenset(
    ("a", "button", "code", "dfn", "figcaption", "h1", "h2", "h3", "pre", "script", "style", "td")
)
"""Elements within which nothing is marked: headings, captions, code, and the cells of tables."""


def _pattern() -> re.Pattern[str]:
    def form(term: str) -> str:
        first = term[0]
        both = f"[{first.upper()}{first}]" if term[1:2].islower() and first.islower() else first
        return f"{both}{re.escape(term[1:])}"

    terms = sorted(TERMS, key=len, reverse=True)
    return re.compile(r"(?<![\w-])(?:" + "|".join(map(form, terms)) + r")(?:e?s)?(?![\w-])")


_FORMS: Final = _pattern()


def _term(written: str) -> str:
    """The key of a term as it is written in a text."""
    for form in (written, written[0].lower() + written[1:]):
        for key in (form, form.removesuffix("s"), form.removesuffix("es")):
            if key in TERMS:
                return key
    raise KeyError(written)


def explained(body: str) -> tuple[str, set[str]]:
    """Marks the first use of every term in every section with its definition.

    Args:
        body: HTML whose sections begin with <h2>.

    Returns:
        The HTML, and the terms that it marks.
    """
    parts: list[str] = []
    seen: set[str] = set()
    marked: set[str] = set()
    silent: list[str] = []
    at = 0

    def mark(found: re.Match[str]) -> str:
        term = _term(found[0])
        if term in seen:
            return found[0]
        seen.add(term)
        marked.add(term)
        return f'<dfn tabindex="0" title="{html.escape(TERMS[term])}">{found[0]}</dfn>'

    while (opens := body.find("<", at)) >= 0:  # not a pattern: attributes hold whole pictures
        text = body[at:opens]
        parts.append(text if silent else _FORMS.sub(mark, text))
        at = body.find(">", opens) + 1
        name = body[opens + 1 : opens + 12].split(">")[0].split()[0]
        if name == "h2":
            seen.clear()
        if name in _SILENT:
            silent.append(name)
        elif silent and name == f"/{silent[-1]}":
            silent.pop()
        parts.append(body[opens:at])
    parts.append(body[at:])
    return "".join(parts), marked


def terms_list(terms: Collection[str]) -> str:
    """HTML of the section that explains the terms, for print and for reading it through."""
    rows = "".join(
        f"<dt>{html.escape(term)}</dt><dd>{html.escape(TERMS[term])}</dd>"
        for term in sorted(terms, key=str.lower)
    )
    return f'<h2>Terms</h2><dl class="terms">{rows}</dl>' if terms else ""
