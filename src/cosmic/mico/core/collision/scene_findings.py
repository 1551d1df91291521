"""What is found wrong, or odd, while a scene is read; all of it at once."""

from dataclasses import dataclass, field

from cosmic.frame.errors import ConfigError


@dataclass
class Findings:
    """Collects lines; one thread.

    Attributes
    ----------
    mistakes : list of str
        Each with file, name and reason; with any of them the scene is not used.
    warnings : list of str
        What may be meant so, and what to look at.
    """

    mistakes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def wrong(self, where: object, text: str) -> None:
        """Note a mistake."""
        self.mistakes.append(f"{where}: {text}")

    def odd(self, where: object, text: str) -> None:
        """Note a warning."""
        self.warnings.append(f"{where}: {text}")

    def raise_mistakes(self) -> None:
        """Raise what was found.

        Raises
        ------
        ConfigError
            A line for every mistake.
        """
        if self.mistakes:
            raise ConfigError("\n".join(self.mistakes))
