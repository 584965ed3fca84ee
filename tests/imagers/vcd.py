"""A VCD read by the words of its standard."""

import re


def read_vcd(text):
    """{full name: (width, [(ps, value), ...])} of a VCD, read by the standard's own words."""
    head, _, body = text.partition("$enddefinitions $end\n")
    assert "$timescale 1 ps $end" in head
    scopes, names, found = [], {}, {}
    for line in head.splitlines():
        words = line.split() or [""]
        if words[0] == "$scope":
            scopes.append(words[2])
        elif words[0] == "$upscope":
            scopes.pop()
        elif words[0] == "$var":
            name = ".".join([*scopes[1:], words[4]])
            names[words[3]] = name
            found[name] = (int(words[2]), [])
    now = None
    for line in body.splitlines():
        if line.startswith("$"):
            continue
        if line.startswith("#"):
            assert now is None or int(line[1:]) > now
            now = int(line[1:])
            continue
        value, key = re.fullmatch(r"b([01]+) (\S+)|([01])(\S+)", line).groups()[:2]
        if key is None:
            value, key = line[0], line[1:]
        found[names[key]][1].append((now, int(value, 2)))
    return found
