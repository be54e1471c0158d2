"""Collision kernels: one file per law, a user's own function, or a formula."""

from .additive import Additive
from .ballistic import Ballistic
from .base import Kernel
from .bilinear import Bilinear
from .brownian import Brownian
from .clusters import Clusters
from .constant import Constant
from .dahneke import Dahneke
from .formula_kernel import FormulaKernel, formula
from .fuchs import Fuchs
from .function import FunctionKernel, from_function
from .generalized_brownian import GeneralizedBrownian
from .long import Long
from .majorant import Majorant
from .multiplicative import Multiplicative
from .product import Product
from .registry import by_name, from_dict
from .sedimentation import Sedimentation
from .shear import Shear
from .sum import Sum

#: every law; the name in a case file is its ``name``
KERNELS: tuple[type[Kernel], ...] = (
    Constant,
    Additive,
    Multiplicative,
    Bilinear,
    Product,
    Ballistic,
    Brownian,
    GeneralizedBrownian,
    Shear,
    Sedimentation,
    Fuchs,
    Dahneke,
    Long,
    Clusters,
)

__all__ = [
    "KERNELS",
    "Additive",
    "Ballistic",
    "Bilinear",
    "Brownian",
    "Clusters",
    "Constant",
    "Dahneke",
    "FormulaKernel",
    "Fuchs",
    "FunctionKernel",
    "GeneralizedBrownian",
    "Kernel",
    "Long",
    "Majorant",
    "Multiplicative",
    "Product",
    "Sedimentation",
    "Shear",
    "Sum",
    "by_name",
    "formula",
    "from_dict",
    "from_function",
]
