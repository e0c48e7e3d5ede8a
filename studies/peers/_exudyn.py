"""Exudyn: generalised-alpha, three of its beams.

- planar (ObjectBeamGeometricallyExact2D, three nodes): the whole case, in a plane.
- cable (ObjectANCFCable): spatial bending and stretching, neither torsion nor shear. It takes no torque: the couple is
  the equivalent pair of forces on the slope coordinates of the tip, a Python function.
- spatial (ObjectBeamGeometricallyExact): version 1.13.6 accepts a damping matrix and ignores it. Rotational dampers
  between neighbouring nodes damp bending and torsion; stretch and shear stay undamped.
"""

import contextlib
import io
import os
import time
from collections.abc import Callable
from importlib.metadata import version
from itertools import pairwise
from typing import Any

import numpy as np

from .case import (
    AREA,
    COUPLE,
    DENSITY,
    DURATION,
    EA,
    EI,
    GA,
    GJ,
    INERTIA,
    LENGTH,
    POLAR,
    SAMPLE,
    TIMES,
    VEA,
    VEI,
    VGA,
    VGJ,
    Run,
    steps_a_sample,
)


def exudyn(beam: str = "planar", elements: int = 3, step: float = SAMPLE / 3) -> Run:
    """Generalised-alpha with modified Newton, dense Jacobian, no files; `beam` is planar, cable or spatial."""
    os.environ["EXUDYN_MODULE"] = "fast"  # the build without range checks
    with contextlib.redirect_stdout(io.StringIO()):
        import exudyn as exu  # pyright: ignore[reportMissingImports]
        import exudyn.itemInterface as items  # pyright: ignore[reportMissingImports]
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime = DURATION
    settings.timeIntegration.numberOfSteps = steps_a_sample(step) * len(TIMES)
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.newton.relativeTolerance = 1e-5
    settings.linearSolver.solverType = exu.LinearSolverType.EigenDense
    settings.parallel.numberOfThreads = 1
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = SAMPLE
    build = {"planar": _planar_beam, "cable": _cable, "spatial": _spatial_beam}[beam]
    setup, walls, stored = float("nan"), [], np.empty(0)
    for _ in range(7):
        start = time.perf_counter()
        system = exu.SystemContainer().AddSystem()
        nodes, clamped = build(exu, items, system, elements)
        ground = system.AddMarker(
            items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0)
        )
        for coordinate in clamped:
            marker = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=coordinate))
            system.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[ground, marker]))
        position = exu.OutputVariableType.Position
        sensor = items.SensorNode(nodeNumber=nodes[-1], outputVariableType=position, storeInternal=True)
        sensor = system.AddSensor(sensor)
        system.Assemble()
        built = time.perf_counter()
        system.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
        walls.append(time.perf_counter() - built)
        setup = built - start
        stored = np.array(system.GetSensorStoredData(sensor))[1:]
    name = f"Exudyn {version('exudyn')}, {beam}, {elements} elements, {1e3 * step:.3g} ms"
    # Free coordinates: planar elements have three nodes of three coordinates, the others two of six.
    return Run(name, beam != "planar", 6 * elements, stored[:, 0], stored[:, 1:], min(walls), setup)


def _planar_beam(exu: Any, items: Any, system: Any, elements: int) -> tuple[list[int], range]:
    stations = np.linspace(0, LENGTH, 2 * elements + 1)
    nodes = [system.AddNode(items.NodeRigidBody2D(referenceCoordinates=[x, 0, 0])) for x in stations]
    for i in range(elements):
        inertial = {"massPerLength": DENSITY * AREA, "crossSectionInertia": DENSITY * INERTIA}
        stiffness = {"bendingStiffness": EI, "axialStiffness": EA, "shearStiffness": GA}
        damping = {"bendingDamping": VEI, "axialDamping": VEA, "shearDamping": VGA}
        element = {"nodeNumbers": nodes[2 * i : 2 * i + 3], "length": LENGTH / elements}
        beam = items.ObjectBeamGeometricallyExact2D(**element, **inertial, **stiffness, **damping)
        system.AddObject(beam)
    tip = system.AddMarker(items.MarkerNodeRigid(nodeNumber=nodes[-1]))
    system.AddLoad(items.LoadTorqueVector(markerNumber=tip, loadVector=[0, 0, COUPLE]))
    return nodes, range(3)


def _cable(exu: Any, items: Any, system: Any, elements: int) -> tuple[list[int], list[int]]:
    stations = np.linspace(0, LENGTH, elements + 1)
    nodes = [system.AddNode(items.NodePointSlope1(referenceCoordinates=[x, 0, 0, 1, 0, 0])) for x in stations]
    for pair in pairwise(nodes):
        element = {"nodeNumbers": list(pair), "length": LENGTH / elements, "massPerLength": DENSITY * AREA}
        section = {"bendingStiffness": EI, "axialStiffness": EA, "bendingDamping": VEI, "axialDamping": VEA}
        system.AddObject(items.ObjectANCFCable(**element, **section, useReducedOrderIntegration=1))
    slope, coordinates = np.array([1.0, 0.0]), exu.OutputVariableType.Coordinates

    def force(axis: int) -> Callable[[Any, float, float], float]:
        def load(mbs: Any, t: float, value: float) -> float:
            x, y = slope + mbs.GetNodeOutput(nodes[-1], coordinates)[3:5]
            return COUPLE * (-y, x)[axis] / (x * x + y * y)

        return load

    for axis in range(2):
        marker = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[-1], coordinate=3 + axis))
        system.AddLoad(items.LoadCoordinate(markerNumber=marker, load=COUPLE, loadUserFunction=force(axis)))
    return nodes, [0, 1, 2, 4, 5]


def _spatial_beam(exu: Any, items: Any, system: Any, elements: int) -> tuple[list[int], list[int]]:
    section, length = exu.BeamSection(), LENGTH / elements
    section.stiffnessMatrix = np.diag([EA, GA, GA, GJ, EI, EI])
    section.inertia = DENSITY * np.diag([POLAR, INERTIA, INERTIA])
    section.massPerLength = DENSITY * AREA
    damping = np.diag([0, 0, 0, VGJ, VEI, VEI]) / length
    stations = np.linspace(0, LENGTH, elements + 1)
    nodes = [system.AddNode(items.NodeRigidBodyEP(referenceCoordinates=[x, 0, 0, 1, 0, 0, 0])) for x in stations]
    markers = [system.AddMarker(items.MarkerNodeRigid(nodeNumber=node)) for node in nodes]
    for i in range(elements):
        beam = items.ObjectBeamGeometricallyExact(nodeNumbers=nodes[i : i + 2], length=length, sectionData=section)
        damper = items.ObjectConnectorRigidBodySpringDamper(markerNumbers=markers[i : i + 2], damping=damping)
        system.AddObject(beam)
        system.AddObject(damper)
    system.AddLoad(items.LoadTorqueVector(markerNumber=markers[-1], loadVector=[0, 0, COUPLE]))
    return nodes, [0, 1, 2, 4, 5, 6]
