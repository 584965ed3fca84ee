"""to come"""


def rate_bound() -> float:
    return 0.0


__all__ = ["rate_bound"]
