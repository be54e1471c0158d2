"""Compilation of pieces, which exist only to become part of a loop.

Numba optimises every function with all it calls, and makes machine code of it, before a caller can
use it. For pieces that is work thrown away, again at every level: their code is optimised once,
where the loop has taken it in. This halves the time a loop takes to compile. It hooks in at private
names; should they be gone, pieces are compiled as any function.
"""

from __future__ import annotations

from typing import Any

try:
    from numba.core.codegen import CPUCodeLibrary
    from numba.core.compiler import CompilerBase, DefaultPassBuilder, _LowerResult
    from numba.core.compiler_machinery import register_pass
    from numba.core.typed_passes import NativeLowering

    AVAILABLE = all(
        hasattr(CPUCodeLibrary, name)
        for name in (
            "_optimize_final_module",
            "_finalize_final_module",
            "_finalize_dynamic_globals",
        )
    )
except ImportError:  # a later Numba
    AVAILABLE = False


def _nothing() -> None:
    pass


if AVAILABLE:

    @register_pass(mutates_CFG=True, analysis_only=False)
    class _PieceLowering(NativeLowering):
        """Lower to LLVM's language and stop there."""

        _name = "smolux_piece_lowering"

        def run_pass(self, state: Any) -> bool:
            library = state.targetctx.codegen().create_library(state.func_id.func_qualname)
            library.enable_object_caching()

            def close() -> None:
                library._finalize_dynamic_globals()
                library._verify_declare_only_symbols()
                library._finalized = True

            library._optimize_final_module = _nothing
            library._finalize_final_module = close
            state.library = library
            state.flags.no_compile = True
            super().run_pass(state)
            lowered = state["cr"]
            # stands for the function where Numba keeps addresses: a builtin, and no other's
            name = [].append  # type: ignore[var-annotated]
            state.targetctx.insert_user_function(name, lowered.fndesc, [library])
            state.reload_init.extend(library._reload_init)
            state["cr"] = _LowerResult(
                lowered.fndesc, lowered.call_helper, cfunc=name, env=lowered.env
            )
            return True

    class PieceCompiler(CompilerBase):
        """Numba's pipeline, without machine code."""

        def define_pipelines(self) -> list[Any]:
            """Return the one pipeline."""
            pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
            pipeline.passes = [
                (_PieceLowering if step is NativeLowering else step, why)
                for step, why in pipeline.passes
            ]
            pipeline._finalized = False
            pipeline.finalize()
            return [pipeline]


def options() -> dict[str, Any]:
    """Return the options of ``numba.njit`` for a piece."""
    return {"pipeline_class": PieceCompiler} if AVAILABLE else {}
