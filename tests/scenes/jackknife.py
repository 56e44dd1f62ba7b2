"""Calibrations compared: how far they are apart, and how far they say they may be."""

from dataclasses import replace

import numpy as np

from thesis_lib.measure.calibration.bundle_adjustment import (
    POSE_UNKNOWNS,
    adjust_bundle,
    align_cameras,
    camera_deviations,
    transform_network,
)


def differences(cameras, others):
    """Lenses, then centres and turns about a common frame, of all cameras less others."""
    lenses = [
        np.r_[(p.K - q.K)[[0, 1, 0, 1], [0, 1, 2, 2]], (p.distortion - q.distortion)[:4]]
        for p, q in zip(cameras, others, strict=True)
    ]
    places = align_cameras(cameras, others)[1:] if len(cameras) > 1 else []
    return np.concatenate([*lenses, *(each.ravel() for each in places)])


def deviations_of(adjustment):
    """What an adjustment states of these; a single camera's place is free."""
    lenses = adjustment.deviations.ravel()
    if len(adjustment.cameras) == 1:
        return lenses
    places = camera_deviations(adjustment, adjustment.covariance)
    return np.concatenate([lenses, *(each.ravel() for each in places)])


def of_covariance(adjustment):
    """The same without what they are widened by."""
    count = adjustment.deviations.size
    lenses = np.sqrt(np.diag(adjustment.covariance))[-count:]
    return np.concatenate([lenses, deviations_of(adjustment)[count:]])


def refitted(observations, points, full):
    """The same deviations by the full jackknife: adjusted anew without each shot."""
    count = observations.shape[1]
    rest = [
        adjust_bundle(np.delete(observations, shot, axis=1), points, full.cameras).cameras
        for shot in range(count)
    ]
    apart = np.array([differences(cameras, full.cameras) for cameras in rest])
    return np.sqrt((count - 1) * np.var(apart, axis=0))


def transform_adjustment(adjustment, rotation, translation):
    """The adjustment and its covariance transformed to X' = rotation X + translation."""
    network = transform_network(adjustment, rotation, translation)
    T = np.eye(len(adjustment.covariance))
    n = len(network.cameras)
    for k in range(n + len(network.rotations)):
        a, b, c = k * POSE_UNKNOWNS, k * POSE_UNKNOWNS + 3, (k + 1) * POSE_UNKNOWNS
        T[b:c, b:c] = rotation
        if k >= n:  # a board turns about the world's axes, a camera about its own
            T[a:b, a:b] = rotation
    return replace(
        adjustment,
        cameras=network.cameras,
        rotations=network.rotations,
        translations=network.translations,
        covariance=T @ adjustment.covariance @ T.T,
    )
