"""The items of a data set as tensors of PyTorch, which is the extra `torch`."""

from __future__ import annotations

from typing import Any, Protocol

from cosim import InputError

try:
    import torch
    from torch.utils.data import Dataset
except ImportError:
    raise InputError(
        "viform.torch_dataset", "used where PyTorch is installed", "without it",
        "pip install 'viform[torch]', or use viform.SpikeDataset for numpy arrays",
    ) from None  # fmt: skip


class Items(Protocol):
    """Dictionaries of arrays and texts, by number."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> dict[str, Any]: ...


class TorchSpikeDataset(Dataset):  # type: ignore[misc, type-arg, unused-ignore]
    """The items of a `SpikeDataset`, each array a tensor of the same shape and type."""

    def __init__(self, items: Items) -> None:
        self.items = items

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: int) -> dict[str, Any]:
        return {
            key: value if isinstance(value, str) else torch.from_numpy(value)
            for key, value in self.items[index].items()
        }
