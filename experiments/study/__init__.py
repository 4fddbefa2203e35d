"""What every study consists of, how it is conducted, and how it tells what was found."""

from experiments.study.page import Page
from experiments.study.plan import Part, Settings, Study, Task, task
from experiments.study.stored import Found, Stored
from experiments.study.table import Cell, Table

__all__ = ["Cell", "Found", "Page", "Part", "Settings", "Stored", "Study", "Table", "Task", "task"]
