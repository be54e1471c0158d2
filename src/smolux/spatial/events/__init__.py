"""The compiled part of the event-driven methods: geometry, grids, searches, replay."""
