"""The folder of results that come with this project, which pages, figures and notebooks read."""

from pathlib import Path

STORED = Path(__file__).parent / "stored"
