"""Pictures of solids, rendered off the screen: the faces of a drawing numbered, and stress on deflected shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vjm.rotations import Array
from vjm_fea.solid.compliance import TipLoad
from vjm_fea.solid.elasticity import von_mises
from vjm_fea.solid.faces import Face
from vjm_fea.solid.identify import SolidCompliance
from vjm_output import off_screen
from vjm_output.number_text import number
from vjm_output.plot_style import PAGE_WIDTH, figure, png
from vjm_updating.constants import shown

SIZE = shown((1100, 850))
"""Of a rendered panel, pixels."""
DRAWN = shown(0.08)
"""Largest displacement as drawn, over the part's diagonal."""
CLIP = shown(99.5)
"""Percentile of stress at which the colours end: at a clamped edge the largest has no bound."""
LOADS = ("force along x", "force along y", "force along z", "moment about x", "moment about y", "moment about z")
COLOURS = ("#56B4E9", "#E69F00", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7", "#999999")


TRIED = shown(100)
"""Triangles of a face, about, of which a visible one is sought for its number."""


def numbered_faces(faces: Sequence[Face]) -> bytes:
    """A PNG file of a drawing seen from two sides, every face in a colour with its number."""
    with figure(0.5 * PAGE_WIDTH * SIZE[1] / SIZE[0] + 0.3) as (fig, axes):
        for ax, view in zip(axes, ((1.0, -1.4, 0.9), (-1.0, 1.4, -0.9)), strict=True):
            ax.imshow(_faces_from(faces, view))
            ax.set(xticks=[], yticks=[])
            ax.spines[:].set_visible(False)
        return png(fig)


def _faces_from(faces: Sequence[Face], view: tuple[float, float, float]) -> np.ndarray:
    pv = _pyvista()
    plotter = off_screen.plotter(SIZE)
    try:
        plotter.set_background("white")
        for i, face in enumerate(faces):
            surface = _surface(pv, face.triangles.reshape(-1, 3), np.arange(3 * len(face.triangles)).reshape(-1, 3))
            plotter.add_mesh(surface, color=COLOURS[i % len(COLOURS)], smooth_shading=False)
            border = surface.clean(tolerance=1e-6).extract_feature_edges(
                boundary_edges=True, feature_edges=False, manifold_edges=False
            )
            if border.n_points:
                plotter.add_mesh(border, color="black", line_width=2)
        places, texts = face_numbers(faces, np.asarray(view))
        plotter.add_point_labels(
            places, texts, font_size=26, shape_color="white", shape_opacity=0.8, always_visible=False, point_size=1
        )
        plotter.view_vector(view, viewup=(0.0, 0.0, 1.0))
        plotter.enable_parallel_projection()
        plotter.reset_camera()
        return np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def face_numbers(faces: Sequence[Face], view: Array) -> tuple[Array, list[str]]:
    """Where to write the numbers of the faces that are seen: on the visible triangle nearest to the centre."""
    places, texts = [], []
    toward = view / np.linalg.norm(view)
    every = np.concatenate([face.triangles for face in faces])
    size = float(np.linalg.norm(np.ptp(every.reshape(-1, 3), axis=0)))
    for face in faces:
        centres = face.triangles.mean(axis=1)
        order = np.argsort(np.linalg.norm(centres - face.centre, axis=1))
        # evenly through the face, the centre first
        tried = order[:: max(1, len(order) // TRIED)]
        seen = next((centres[k] for k in tried if not _covered(centres[k], toward, every, 1e-6 * size)), None)
        if seen is not None:
            # a little in front of the face, which hides what lies on it
            places.append(seen + 0.02 * size * toward)
            texts.append(str(face.number) if not face.name else f"{face.number} {face.name}")
    return np.array(places).reshape(-1, 3), texts


def _covered(point: Array, toward: Array, triangles: Array, near: float) -> bool:
    """Whether a triangle ``(k, 3, 3)`` lies between a point and a viewer far away (Möller and Trumbore's test)."""
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(toward, e2)
    det = np.sum(e1 * p, axis=1)
    met = det != 0.0
    det = np.where(met, det, 1.0)
    u = np.sum((point - a) * p, axis=1) / det
    q = np.cross(point - a, e1)
    v, t = q @ toward / det, np.sum(e2 * q, axis=1) / det
    return bool(np.any(met & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > near)))


def load_pictures(found: SolidCompliance, tip: TipLoad) -> bytes:
    """A PNG file of six panels: von Mises stress on the shape that each unit wrench deflects."""
    return _panels(found, [(LOADS[k], found.answers[tip].displacements[:, k], k < 3) for k in range(6)])


def wrench_picture(found: SolidCompliance, tip: TipLoad, wrench: Array) -> bytes:
    """A PNG file of von Mises stress on the deflected shape under a wrench ``(6,)`` N, N mm."""
    return _panels(found, [("the wrench", found.answers[tip].displacements @ wrench, None)])


def _panels(found: SolidCompliance, cases: Sequence[tuple[str, Array, bool | None]]) -> bytes:
    columns = min(3, len(cases))
    rows = len(cases) // columns
    width = PAGE_WIDTH / columns
    with figure(rows * (width * SIZE[1] / SIZE[0] + 0.45), columns, rows=rows) as (fig, axes):
        for ax, (name, u, force) in zip(axes, cases, strict=True):
            stress = von_mises(found.solid.stress(u))
            points = found.solid.mesh.points
            largest = float(np.max(np.linalg.norm(u.reshape(-1, 3), axis=1)))
            factor = DRAWN * float(np.linalg.norm(np.ptp(points, axis=0))) / max(largest, 1e-300)
            top = float(np.percentile(stress, CLIP))
            ax.imshow(_deflected(found, u, stress, factor, top))
            ax.set(xticks=[], yticks=[])
            ax.spines[:].set_visible(False)
            unit = {True: "MPa per N", False: "MPa per N mm", None: "MPa"}[force]
            ax.set_title(f"{name}\nvon Mises 0 to {number(top, 3)} {unit}", fontsize=7.5)
        return png(fig)


def _deflected(found: SolidCompliance, u: Array, stress: Array, factor: float, top: float) -> np.ndarray:
    pv = _pyvista()
    points, triangles = found.solid.mesh.points, np.concatenate(list(found.solid.mesh.faces.values()))
    plotter = off_screen.plotter(SIZE)
    try:
        plotter.set_background("white")
        rest = _surface(pv, points, triangles)
        plotter.add_mesh(rest, color="#d0d0d0", opacity=0.25)
        moved = _surface(pv, points + factor * u.reshape(-1, 3), triangles)
        moved["stress"] = stress
        plotter.add_mesh(moved, scalars="stress", cmap="viridis", clim=(0.0, top), show_scalar_bar=False)
        plotter.view_vector((1.0, -1.4, 0.9), viewup=(0.0, 0.0, 1.0))
        plotter.enable_parallel_projection()
        plotter.reset_camera()
        return np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def _surface(pv: Any, points: Array, triangles: np.ndarray) -> Any:  # noqa: ANN401
    cells = np.hstack([np.full((len(triangles), 1), 3), triangles]).ravel()
    return pv.PolyData(np.asarray(points), cells)


def _pyvista() -> Any:  # noqa: ANN401
    # takes seconds to import
    import pyvista

    return pyvista
