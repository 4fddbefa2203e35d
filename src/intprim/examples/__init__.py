"""What the tutorial of chapter 4 is run on."""

from intprim.examples.tutorial import create_2d_handwriting_data, get_phase_stats, train_model

__all__ = ["create_2d_handwriting_data", "get_phase_stats", "train_model"]
