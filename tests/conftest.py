"""What holds for every property test: the same examples each time, and no limit on how long one takes."""

from hypothesis import settings

settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")
