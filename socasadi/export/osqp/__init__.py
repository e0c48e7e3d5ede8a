"""OSQP as its own code generator writes it, behind the controller's interface to its QP solver."""

from ._write import OsqpSources, osqp_adapter, write_osqp

__all__ = ["OsqpSources", "osqp_adapter", "write_osqp"]
