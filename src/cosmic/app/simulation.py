"""Makes the scene of a simulated platform, and the file of its truth."""

from pathlib import Path

from cosmic.app.configuration.platform_file import PlatformFile, load_twin
from cosmic.frame.clock import Clock
from cosmic.twin.sample import put_on
from cosmic.twin.scene import Scene
from cosmic.twin.truth import NO_TRUTH, TruthFile


def make_scene(
    file: PlatformFile,
    path: Path,
    clock: Clock,
    *,
    seed: int,
    cold: bool,
    sample: str | None,
    truth: str | Path | None,
) -> Scene:
    """Return the scene that a platform file describes, with a sample on the plate.

    Parameters
    ----------
    sample : str or None
        Its name in twin.toml; None: the fibres that are listed there.
    truth : path or None
        Where to write what truly happens; nothing on the platform reads it back.

    Raises
    ------
    ConfigError
        The configuration is wrong, there is no such sample, or `truth` cannot be written.
    """
    twin = load_twin(file, path)
    twin = twin if sample is None else put_on(twin, sample, seed)
    told = NO_TRUTH if truth is None else TruthFile(Path(truth))
    try:
        return Scene.from_settings(
            twin,
            clock,
            seed,
            cold=cold,
            folder=path.parent,
            sample=sample or "",
            truth=told,
            apart=True,
        )
    except BaseException:
        told.close()
        raise
