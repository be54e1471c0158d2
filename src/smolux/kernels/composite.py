"""Kernels made of kernels: what is known of them is known of their parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .base import Float, Kernel


@dataclass(frozen=True)
class MadeOfKernels(Kernel):
    """A law of other laws."""

    @property
    def made_of(self) -> tuple[Kernel, ...]:
        """The laws that it is made of."""
        raise NotImplementedError

    @property
    def rigorous(self) -> bool:  # type: ignore[override]
        """See `Kernel.rigorous`."""
        return all(kernel.rigorous for kernel in self.made_of)

    @property
    def searched(self) -> bool:  # type: ignore[override]
        """See `Kernel.searched`."""
        return any(kernel.searched for kernel in self.made_of)

    @property
    def arbitrary(self) -> bool:  # type: ignore[override]
        """See `Kernel.arbitrary`."""
        return any(kernel.arbitrary for kernel in self.made_of)

    @property
    def monomer(self) -> dict[str, float]:
        return {key: x for kernel in self.made_of for key, x in kernel.monomer.items()}

    @property
    def singled_out(self) -> Float:
        return np.unique(np.concatenate([kernel.singled_out for kernel in self.made_of]))
