"""Settings shared by all tests."""

import os

# Several workers with several BLAS threads each wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# So do several workers whose threads spin while they wait.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

from hypothesis import HealthCheck, settings

settings.register_profile(
    "pyfric", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("pyfric")
