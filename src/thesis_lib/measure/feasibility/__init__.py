"""Feasibility of planned measurements: predicted performance, checks, draft manifests."""
