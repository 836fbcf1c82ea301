"""Deployments: Compose files and the runner that starts their services as local processes."""
