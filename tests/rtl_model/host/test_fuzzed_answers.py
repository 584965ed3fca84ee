"""Random errors in answers, in simulated time: each transaction ends within its time limit, and a
word that is read twice is right or refused."""

import random

import pytest

from rtl_model.host import Cause, LineFault, Uartbone

BAUD = 115_200
BYTE_S = 10 / BAUD


class SpoilingPort:
    """A memory whose words are a function of the address, behind a line that spoils a share of the
    answers. It accepts reads only; no wall time passes."""

    name = "spoilt"
    baud = BAUD

    def __init__(self, seed, share):
        self.random = random.Random(seed)
        self.share = share
        self.time = 0.0
        self.input = []
        self.kinds = set()

    def now(self):
        return self.time

    def write(self, data, deadline_s=1.0):
        assert deadline_s > 0 and len(data) == 6 and data[0] in (2, 4)
        self.time += 6 * BYTE_S
        address = int.from_bytes(data[2:], "big")
        answer = b"".join(word(address + (data[0] == 2) * n) for n in range(data[1]))
        at = self.time
        if self.random.random() < self.share:
            kind = self.random.choice(
                ["silent", "cut", "longer", "flip", "lost", "garbage", "echo", "late", "chatter"]
            )
            self.kinds.add(kind)
            answer, at = self.spoil(kind, bytearray(answer), data, at)
        for byte in answer:
            at = at + BYTE_S
            self.input.append((at, byte))
        self.input.sort(key=lambda each: each[0])

    def spoil(self, kind, answer, asked, at):
        r = self.random
        some = bytes(r.randrange(256) for _ in range(r.randrange(1, 300)))
        place = r.randrange(len(answer))
        if kind == "flip":
            answer[place] ^= 1 << r.randrange(8)
        elif kind == "lost":
            del answer[place]
        elif kind == "late":
            at += r.uniform(0, 2)
        made = {
            "silent": b"",
            "cut": bytes(answer[:place]),
            "longer": bytes(answer) + some,
            "garbage": some,
            "echo": asked + bytes(answer),
            "chatter": some[:3] + bytes(answer) + some,
        }
        return made.get(kind, bytes(answer)), at

    def read(self, count, deadline_s):
        assert 0 <= deadline_s < 30
        end, got = self.time + deadline_s, b""
        while len(got) < count and self.input and self.input[0][0] <= end:
            at, byte = self.input.pop(0)
            self.time = max(self.time, at)
            got += bytes([byte])
        if len(got) < count:
            self.time = end
        return got

    def drain(self):
        return self.read(sum(at <= self.time for at, _ in self.input), 0.0)


def word(address):
    return ((address * 2654435761 + 12345) & 0xFFFFFFFF).to_bytes(4, "big")


@pytest.mark.parametrize("count", [1000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_no_answer_hangs_the_host_or_is_read_wrong_twice(count):
    port = SpoilingPort(seed=5, share=0.3)
    bone = Uartbone(port)
    pick = random.Random(6)
    right = refused = 0
    causes = set()
    for _ in range(count):
        address, words = 4 * pick.randrange(1 << 20), pick.randrange(1, 40)
        wanted = [int.from_bytes(word(address // 4 + n), "big") for n in range(words)]
        before = port.now()
        try:
            assert bone.read_twice(address, words) == wanted
            right += 1
        except LineFault as fault:
            causes.add(fault.cause)
            refused += 1
            bone.resynchronise()
        assert port.now() - before < 60
    assert port.kinds == {
        "silent", "cut", "longer", "flip", "lost", "garbage", "echo", "late", "chatter"
    }  # fmt: skip
    assert right > refused > 0
    assert causes <= {Cause.SILENT, Cause.SHORT, Cause.GARBLED, Cause.ECHO}
