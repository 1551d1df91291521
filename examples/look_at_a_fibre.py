"""Look at a fibre, measure it, calibrate with a gripper, and record what the camera sees."""

import tempfile
from pathlib import Path

import cv2

import cosmic
from cosmic.vico.api.fibres import PlacedFibre


def look(rig: cosmic.Rig) -> None:
    """Zoom to 2x and find the focus, on images exposed after each movement."""
    vico = rig.vico
    assert vico.lens is not None
    vico.lens.zoom_to(2.0).wait()
    vico.lens.autofocus().wait()
    print(f"zoom {vico.lens.zoom:.1f}x, image of {vico.snap().shape}")


def nearest(rig: cosmic.Rig) -> PlacedFibre:
    """Return the fibre nearest to the middle of the image."""
    return min(
        rig.vico.find_fibres(),
        key=lambda fibre: abs(fibre.centre_line_px.mean(axis=0) - (800.0, 600.0)).sum(),
    )


def measure(rig: cosmic.Rig) -> None:
    """Say how long, wide and curled the fibre is, and how sure that is."""
    fibre = nearest(rig)
    print(f"length: {fibre.length_um:.1f} +- {fibre.length_std_um:.1f} um")
    print(f"width: {fibre.width_um:.1f} um, curl index {fibre.curl:.3f}, certain {fibre.certain}")


def calibrate(rig: cosmic.Rig) -> None:
    """Bring the right gripper into the image, 50 um above the plate, and calibrate with it."""
    rig.mico["right.x"].move_to(-3000.0)
    rig.mico["right.z"].move_to(-1450.0)
    rig.vico.calibrate_stage("right").wait()
    for found in rig.vico.calibrated:
        print(f"{found.tool}: {found.scale_um_px:.4f} um a pixel, {found.residual_px:.2f} px off")


def move_by_click(rig: cosmic.Rig) -> None:
    """Move the gripper's tip over a position of the image, through the gate as every move."""
    camera = rig.vico.camera()
    print(camera.click_to_move((1250.0, 600.0), "right"))


def record(rig: cosmic.Rig, file: Path) -> None:
    """Record some images without loss, and open them with a program that is not ours."""
    with rig.vico.record(file):
        for _ in range(3):
            rig.vico.snap()
    film = cv2.VideoCapture(str(file))
    whole, first = film.read()
    film.release()
    print(f"recorded: {whole}, {first.shape[1]} x {first.shape[0]} px")


def main() -> None:
    """Do all of it on the simulated platform, twice as fast as in truth."""
    with tempfile.TemporaryDirectory() as folder, cosmic.connect(rate=2.0, world="plain") as rig:
        look(rig)
        measure(rig)
        calibrate(rig)
        rig.mico["right.x"].move_to(-1000.0)
        ends_um = nearest(rig).ends_um
        print("ends:", "not known" if ends_um is None else ends_um.round(1).tolist())
        record(rig, Path(folder) / "look.mkv")


if __name__ == "__main__":
    main()
