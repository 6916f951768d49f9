"""Client of gonio, a virtual gonioreflectometer: height fields to BRDF tables, each value with its error.

    Client      a server; Client.submit gives a Job, Job.wait(), Job.table() a Table
    run         the same job by the program on this machine
    run_files   any kind of job by that program, into files
    read_table  a table from a CSV or JSON file
    read_arrays a BTF, light field or maps from a file
    run_projection, read_projection   a Projection to spherical harmonics, which gives the BRDF anywhere
    GonioError  what everything here raises; see gonio.errors for its kinds
"""
from .arrays import Arrays, read_arrays
from .client import Client
from .download import Output
from .errors import (ApiError, ChecksumError, GonioError, InvalidTable, JobDismissed, JobFailed, Refused, TimedOut,
                     Unreachable)
from .job import Job
from .local import run, run_files, run_projection
from .projection import Projection, harmonics, read_projection
from .status import Status
from .table import Table
from .table_files import read_table

__all__ = ["ApiError", "Arrays", "ChecksumError", "Client", "GonioError", "InvalidTable", "Job", "JobDismissed", "JobFailed",
           "Output", "Projection", "Refused", "Status", "Table", "TimedOut", "Unreachable", "harmonics", "read_arrays",
           "read_projection", "read_table", "run", "run_files", "run_projection"]
