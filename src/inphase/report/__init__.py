"""Pictures of what a model believes, for papers and notebooks, and the page of a run; the rest is for commands."""

from inphase.report.account import Account, account_of_demonstration, account_of_recording
from inphase.report.correlation import channel_correlation, weight_correlation
from inphase.report.page.document import write_page
from inphase.report.plots.basis import plot_basis
from inphase.report.plots.correlation import plot_correlation
from inphase.report.plots.demonstrations import plot_demonstrations
from inphase.report.plots.model import plot_model
from inphase.report.plots.phase import plot_phase_densities
from inphase.report.plots.response import plot_response

__all__ = [
    "Account",
    "account_of_demonstration",
    "account_of_recording",
    "channel_correlation",
    "plot_basis",
    "plot_correlation",
    "plot_demonstrations",
    "plot_model",
    "plot_phase_densities",
    "plot_response",
    "weight_correlation",
    "write_page",
]
