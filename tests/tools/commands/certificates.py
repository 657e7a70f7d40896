"""What a dask cluster proves who it is with."""

from __future__ import annotations

import subprocess
from pathlib import Path


def certificates(folder: Path) -> dict[str, str]:
    """dask's configuration with a certificate for everybody, made here."""
    cert, key = str(folder / "cert.pem"), str(folder / "key.pem")
    made = ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    to = ["-days", "2", "-subj", "/CN=testbed", "-keyout", key, "-out", cert]
    subprocess.run(["openssl", *made, *to], check=True, capture_output=True)
    roles = ("scheduler", "worker", "client")
    return {
        "distributed.comm.tls.ca-file": cert,
        **{f"distributed.comm.tls.{role}.cert": cert for role in roles},
        **{f"distributed.comm.tls.{role}.key": key for role in roles},
    }
