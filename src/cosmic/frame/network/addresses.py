"""Under which keys stations and clients find each other."""

from cosmic.frame.network.transport import Rule


def greetings(station: str, client: str = "**") -> str:
    """Where a client (its name, a slash and its number) asks to be let in."""
    return f"cosmic/{station}/hello/{client}"


def asks(station: str, client: str) -> str:
    """Where a client that was let in asks."""
    return f"cosmic/{station}/ask/{client}"


def client_liveliness(station: str, client: str = "**") -> str:
    """Sign of life of a client."""
    return f"cosmic/{station}/client/{client}"


def session_events(station: str, client: str) -> str:
    """Where a client hears what concerns only itself."""
    return f"cosmic/{station}/to/{client}"


def topic_key(station: str, topic: str, rule: Rule) -> str:
    """Where a topic is published."""
    return f"cosmic/{station}/topic/{rule.value}/{topic}"


def client_of(key: str) -> str:
    """Return the client's name, a slash and its number, out of one of its keys."""
    return "/".join(key.split("/")[3:5])
