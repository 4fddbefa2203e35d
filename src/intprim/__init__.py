"""The names of chapter 4 of the dissertation, for scripts written for IntPrim, over `inphase`.

So far only `intprim.constants` is here; the rest of the chapter follows (see CHANGELOG).
"""

from intprim import constants

__all__ = ["constants"]
