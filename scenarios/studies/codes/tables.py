"""The document of the bench as Markdown tables, and its figure: sizes of all formats for each
scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cosim.report.figures import subplots

INK, LINE = "#1d2433", "#c8ccd4"
FORMS = (
    ("zstd 19, best order", "#8a94a6", lambda r: min(r["zstd"].values())),
    ("every spike an event", "#d9a441", lambda r: r["events"]),
    ("repeat + zstd", "#9db4d8", lambda r: r["repeat_zstd"]),
    ("line + zstd", "#2f5fa8", lambda r: r["line_zstd"]),
    ("statistical, k = 3", "#e8a07f", lambda r: r["statistical"]["k3"]),
    ("statistical, k = 3, means of 8", "#d9480f", lambda r: r["statistical"]["k3r"]),
)


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


def draw(document: dict[str, Any], path: Path) -> None:
    """Draws bars of bits per pixel and cycle on a logarithmic scale; the line at 1 is the raw
    stream."""
    rows = document["sizes"]
    lights = list(dict.fromkeys(light_name(row) for row in rows))
    figure, axes = subplots(
        len(lights), 1, figsize=(10, 2.1 * len(lights) + 0.6), sharex=True, sharey=True,
        squeeze=False,
    )  # fmt: skip
    wide = 0.8 / len(FORMS)
    least = min(form(row) for _, _, form in FORMS for row in rows)
    bottom = max(least / 2, 1e-5)
    for light, ax in zip(lights, axes[:, 0], strict=True):
        here = [row for row in rows if light_name(row) == light]
        for n, (name, colour, form) in enumerate(FORMS):
            x = [i + (n - (len(FORMS) - 1) / 2) * wide for i in range(len(here))]
            heights = [max(form(row), bottom) - bottom for row in here]
            ax.bar(x, heights, wide * 0.92, bottom, color=colour, label=name)
        ax.axhline(1, color=INK, linewidth=0.9)
        ax.set_yscale("log")
        ax.set_xticks(range(len(here)), [row["scene"] for row in here], color=INK)
        ax.set_title(light, fontsize=10, color=INK, loc="left")
        ax.set_ylabel("bit/pixel-cycle", fontsize=8.5, color=INK)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(color=LINE, labelcolor=INK)
        ax.grid(axis="y", color=LINE, linewidth=0.5)
        ax.set_axisbelow(True)
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="upper center", ncols=len(FORMS), fontsize=8.5, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.96))
    figure.savefig(path, dpi=110, format="png")
