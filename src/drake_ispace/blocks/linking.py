"""Compile kernels so that they are linked into a rollout as they were written, and optimised there.

numba links a function into its caller after it has optimised it by itself, when the sizes of vectors were not known:
loops over wheels are loops then, which no later pass undoes. Here the text of LLVM is kept from before. In a rollout,
where all sizes are constants, LLVM unrolls such loops, and turns loops over lanes into vector instructions.
"""

from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering


class _Lower(Lower):
    """Keeps what is written so far; the wrapper for Python too, as numba looks there for the names of cached code."""

    def lower(self):
        super().lower()
        self._keep()

    def create_cpython_wrapper(self, release_gil=False):
        super().create_cpython_wrapper(release_gil)
        self._keep()

    def create_cfunc_wrapper(self):
        super().create_cfunc_wrapper()
        self._keep()

    def _keep(self):
        library = self.library
        kept = library._final_module.clone()
        for used in library._linking_libraries:
            kept.link_in(used._get_module_for_linking(), preserve=True)
        for function in kept.functions:
            if not function.is_declaration and function.linkage.name == "external":
                function.linkage = "linkonce_odr"
        library._shared_module = kept


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    _name = "lowering_kept_for_linking"
    lowering_class = _Lower


class KernelCompiler(CompilerBase):
    """numba's own pipeline but for what other functions link."""

    def define_pipelines(self):
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [
            (_Lowering, text) if kind is NativeLowering else (kind, text) for kind, text in manager.passes
        ]
        manager.finalize()
        return [manager]
