"""Which errors radiate: radiation modes, and draws of whole pixels against the law."""

import numpy as np
from scipy.stats import qmc

from thesis_lib.acoustics import radiation
from thesis_lib.acoustics.planes import Plane, full_factor, plane_operator, plate_pistons
from thesis_lib.acoustics.radiation import rayleigh_pressure
from thesis_lib.facts import setups
from thesis_lib.vibration.structure import deflection_shape, resonance_frequency
from thesis_lib.vision import rounding
from thesis_lib.vision.pinhole import hemisphere_cameras, project
from thesis_lib.vision.triangulation import triangulate

PLATE = setups.thesis_plate()
OMEGA = resonance_frequency(PLATE, 1)
PLANE = Plane("XZ", 0.334, 0.0445, 0.443, (21, 14))
FACTOR = full_factor(plane_operator(PLATE, PLANE, OMEGA))
MODES = radiation.radiation_modes(FACTOR)


def test_radiation_modes_are_orthogonal_and_the_same_form(conforms):
    norms = np.linalg.norm(MODES, axis=1)
    assert np.all(np.diff(norms) <= 0)
    gram = MODES @ MODES.T / norms[0] ** 2
    conforms.closed_form(gram, np.diag(norms**2 / norms[0] ** 2), atol=1e-13)
    v = np.random.default_rng(1).normal(size=(7, 150))
    found, exact = (np.linalg.norm(v @ F.T, axis=1) for F in (MODES, FACTOR))
    conforms.invariance(found, exact, rtol=1e-12)


def test_only_its_own_mode_hears_a_radiation_mode(conforms):
    """The field of one is orthogonal, over the plane, to the field of any other."""
    ways = MODES[:4] / np.linalg.norm(MODES[:4], axis=1, keepdims=True)
    pistons = plate_pistons(PLATE)
    fields = [rayleigh_pressure(pistons, way, PLANE.points, OMEGA).ravel() for way in ways]
    together = np.real(np.conj(fields) @ np.transpose(fields)) / PLANE.points[0].size
    expected = np.diag(np.sum(MODES[:4] ** 2, axis=1))
    conforms.independent(together / together[0, 0], expected / expected[0, 0], atol=1e-12)


def test_coherence_is_1_of_independent_errors_and_bounded_by_the_loudest_mode(conforms):
    conforms.closed_form(radiation.coherence_ratio(FACTOR, 3.0 * np.eye(150)), 1, rtol=1e-13)
    most = np.sqrt(150 * np.sum(MODES[0] ** 2) / np.sum(MODES**2))
    loudest = np.outer(MODES[0], MODES[0])
    conforms.closed_form(radiation.coherence_ratio(FACTOR, loudest), most, rtol=1e-12)
    for seed in range(5):  # some errors that go together
        some = np.random.default_rng(seed).normal(size=(150, 40))
        conforms.closed_form(radiation.coherence_ratio(FACTOR, some @ some.T), below=most)


def drawn_errors(turn):
    """Errors (draws, markers) of an opposed pair's deflections, from whole pixels alone."""
    w = deflection_shape(PLATE, 1, PLATE.markers, 0.01)
    x, y = PLATE.markers - np.array(PLATE.extent)[:, None] / 2
    points = np.stack(np.broadcast_arrays(x, y, np.stack([0 * w, w])))
    azimuth, elevation = np.radians([turn, 180 + turn]), np.radians([40, 40])
    rig = hemisphere_cameras(0.75, azimuth, elevation, 320 * 24 / 36, (320, 180))
    shift = qmc.Sobol(4, rng=0).random_base2(11).reshape(-1, 2, 2) - 0.5
    shift = np.moveaxis(shift, 0, 2)[..., None]
    images = project(rig.P, points)
    whole = np.rint(images[:, :, :, None] + shift[:, :, None]) - shift[:, :, None]
    rest, moved = triangulate(rig.P, whole)[2]
    return moved - rest - w, rounding.deflection_covariance(rig.P, points[:, 0], points[:, 1])


def test_fields_of_drawn_errors_are_those_that_the_law_predicts(conforms):
    """A turn by 2° takes most of the field and nothing of the shape."""
    fields, shapes = [], []
    for turn in (0, 2):
        errors, C = drawn_errors(turn)
        found = np.mean((errors @ MODES[:3].T) ** 2, axis=0)
        law = radiation.mean_squares(MODES, C)
        conforms.closed_form(np.sum(law), np.trace(FACTOR @ C @ FACTOR.T), rtol=1e-12)
        whole = np.mean(np.sum((errors @ FACTOR.T) ** 2, axis=1))
        conforms.sampled(np.sqrt(np.sum(law) / whole), 1, atol=0.05)
        conforms.sampled(found / whole, law[:3] / np.sum(law), atol=0.03)
        fields.append(np.sqrt(whole))
        shapes.append(np.sqrt(np.mean(errors**2)))
    conforms.sampled(shapes[1] / shapes[0], 1, atol=0.03)
    conforms.sampled(fields[1] / fields[0], below=0.4)
