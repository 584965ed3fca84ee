"""The document of the bench as Markdown tables."""

from __future__ import annotations

from typing import Any


def light_name(row: dict[str, Any]) -> str:
    """Description of the light of a row."""
    return f"Q = {row['threshold']:g}" if row["shot_noise"] else "no shot noise"


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def _layers(n: int) -> str:
    """A number of layers, in words."""
    return "1 layer" if n == 1 else f"{n} layers"


def markdown(document: dict[str, Any]) -> str:
    """Four tables: lossless sizes, the statistical code, the layered code, and steady light with
    its closed forms."""
    lossless, lossy, layered, steady = [], [], [], []
    for row in document["sizes"]:
        place = [row["scene"], light_name(row), f"{row['spike_rate']:.3f}"]
        zstd = row["zstd"]
        lossless.append(
            place
            + [f"{zstd[f'{name}_3']:.3f}" for name in ("plane", "word", "pixel")]
            + [f"{zstd['best_19']:.3f}", f"{row['events']:.2f}"]
            + [f"{row[name]:.3f}" for name in ("repeat", "repeat_zstd", "line", "line_zstd")]
        )
        stream = row["psnr"]["stream"]
        cells = [f"{stream['tfp']:.1f}, {stream['tfi']:.1f}"]
        for name, size in row["statistical"].items():
            left = row["psnr"][name]
            cells.append(f"{size:.4f}: {left['tfp']:.1f}, {left['tfi']:.1f}")
        lossy.append(place[:2] + cells)
        cells = cells[:1]
        for name, size in row["layered"].items():
            left = row["psnr"][name]
            cells.append(f"{size:.4f}: {left['tfp']:.1f}, {left['tfi']:.1f}")
        layered.append(place[:2] + cells)
    for row in document["steady"]:
        steady.append(
            [f"{row['mean']:g}", f"{row['threshold']:g}"]
            + [f"{row[n]:.2f}" for n in ("floor", "ceiling", "zstd", "repeat", "line")]
            + [f"{row['predicted'][k]:.4f} / {row['measured'][k]:.4f}" for k in row["predicted"]]
            + [f"{row['level_error'][n]:.2%}" for n in ("stream", "k3", "k3r", "k5", "k5r")]
        )
    names = list(document["sizes"][0]["statistical"]) if document["sizes"] else []
    rungs = list(document["sizes"][0]["layered"]) if document["sizes"] else []
    ks = list(document["steady"][0]["predicted"]) if document["steady"] else []
    return "\n".join(
        (
            table(
                ["scene", "light", "spikes a cycle", "zstd 3, planes", "zstd 3, words",
                 "zstd 3, pixels", "zstd 19, best", "events", "repeat", "repeat + zstd", "line",
                 "line + zstd"], lossless,
            ),
            table(["scene", "light", "the stream", *names], lossy),
            table(["scene", "light", "the stream", *(_layers(n) for n in rungs)], layered),
            table(
                ["mean width", "Q", "floor", "ceiling", "zstd 19", "repeat", "line",
                 *(f"sent, {k}" for k in ks), "rate error, stream", "k3", "k3r", "k5", "k5r"],
                steady,
            ),
        )
    )  # fmt: skip
