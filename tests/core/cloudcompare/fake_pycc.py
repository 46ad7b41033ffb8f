# ruff: noqa: A002, N801, N802, N803 - the names are CloudCompare's
"""A stand-in for `pycc` and `cccorelib`, as strict as CloudCompare's Python runtime.

Classes, names of arguments and their types are those of the bindings in
github.com/tmontaigu/CloudCompare-PythonRuntime (wrapper/pycc/src, wrapper/cccorelib/src and
src/Runtime, at dd39f54). Whatever is not there raises `AttributeError`; an argument of another
type raises `TypeError`, as pybind11 does.
"""

import contextlib
import threading
from types import ModuleType

import numpy as np

LOG: list[tuple[str, str]] = []


def need(value, *types):
    """Refuse what pybind11 would not convert."""
    if isinstance(value, bool) and bool not in types:
        raise TypeError(f"incompatible function arguments: {value!r}")
    if not isinstance(value, types):
        raise TypeError(f"incompatible function arguments: {value!r}, wanted {types}")
    return value


class CCVector3:
    def __init__(self, x=0.0, y=0.0, z=0.0):
        self.x, self.y, self.z = (float(need(v, float, int)) for v in (x, y, z))


class CCVector3d(CCVector3):
    pass


class Rgb:
    def __init__(self, r, g, b):
        self.r, self.g, self.b = (need(v, int) for v in (r, g, b))


class ccGLMatrix:
    def __init__(self, X=None, Y=None, Z=None, Tr=None):
        self._m = np.eye(4, dtype=np.float32)
        if X is not None:
            for column, v in enumerate((X, Y, Z, Tr)):
                need(v, CCVector3)
                self._m[:3, column] = v.x, v.y, v.z

    def asArray(self):
        return self._m


class ccObject:
    def __init__(self, name=""):
        self._name, self._enabled = need(name, str), True

    def getName(self):
        return self._name

    def setName(self, name):
        self._name = need(name, str)

    def isEnabled(self):
        return self._enabled

    def setEnabled(self, state):
        self._enabled = need(state, bool)


class ccHObject(ccObject):
    def __init__(self, name=""):
        super().__init__(name)
        self._children, self._colors_shown, self._sf_shown = [], False, False

    def addChild(self, child):
        self._children.append(need(child, ccHObject))
        return True

    def getChildrenNumber(self):
        return len(self._children)

    def getChild(self, index):
        return self._children[need(index, int)]

    def hasColors(self):
        return False

    def showColors(self, state):
        self._colors_shown = need(state, bool)

    def showSF(self, state):
        self._sf_shown = need(state, bool)

    def sfShown(self):
        return self._sf_shown


class ccShiftedObject(ccHObject):
    def __init__(self, name=""):
        super().__init__(name)
        self._shift, self._scale = CCVector3d(), 1.0

    def getGlobalShift(self):
        return self._shift

    def setGlobalShift(self, x_, y, z):
        self._shift = CCVector3d(x_, y, z)

    def getGlobalScale(self):
        return self._scale

    def setGlobalScale(self, scale):
        self._scale = float(need(scale, float, int))

    def copyGlobalShiftAndScale(self, s):
        need(s, ccShiftedObject)
        self._shift, self._scale = s._shift, s._scale


class ccScalarField:
    def __init__(self, name, values):
        self._name, self._values, self.is_symmetrical, self.range = name, values, False, None

    def asArray(self):
        return self._values

    def computeMinAndMax(self):
        self.range = np.nanmin(self._values), np.nanmax(self._values)

    def setSymmetricalScale(self, state):
        self.is_symmetrical = need(state, bool)


class ccPointCloud(ccShiftedObject):
    def __init__(self, *arguments, name=""):
        if len(arguments) == 3:
            super().__init__("")
            columns = [np.asarray(a) for a in arguments]
            if any(c.ndim != 1 or len(c) != len(columns[0]) for c in columns):
                raise ValueError("xs, ys, zs must have the same length")
            self._xyz = np.column_stack(columns).astype(np.float32)
        else:
            super().__init__(*arguments, **({"name": name} if name else {}))
            self._xyz = np.empty((0, 3), np.float32)
        self._fields, self._rgba, self._shown, self._scale_shown = [], None, -1, False

    def size(self):
        return len(self._xyz)

    def points(self):
        view = self._xyz.view()
        view.flags.writeable = False
        return view

    def hasColors(self):
        return self._rgba is not None

    def colors(self):
        return self._rgba

    def setColors(self, colors):
        self._rgba = np.column_stack([colors, np.full(len(colors), 255)]).astype(np.uint8)

    def getNumberOfScalarFields(self):
        return len(self._fields)

    def getScalarField(self, index):
        need(index, int)
        return self._fields[index] if 0 <= index < len(self._fields) else None

    def getScalarFieldName(self, index):
        return self._fields[need(index, int)]._name

    def getScalarFieldIndexByName(self, name):
        names = [f._name for f in self._fields]
        return names.index(need(name, str)) if name in names else -1

    def addScalarField(self, name, values=None):
        if self.getScalarFieldIndexByName(name) >= 0:
            raise RuntimeError("Failed to add scalar field")
        column = np.zeros(self.size()) if values is None else np.array(values, np.float32)
        if column.size != self.size():
            raise ValueError("value must have the same len as the point cloud size")
        self._fields.append(ccScalarField(name, column))
        return len(self._fields) - 1

    def deleteScalarField(self, index):
        del self._fields[need(index, int)]

    def setCurrentDisplayedScalarField(self, index):
        self._shown = need(index, int)

    def getCurrentDisplayedScalarFieldIndex(self):
        return self._shown

    def showSFColorsScale(self, state):
        self._scale_shown = need(state, bool)


class ccPolyline(ccShiftedObject):
    def __init__(self, associatedCloud):
        super().__init__()
        self.vertices, self.n_used, self.color = need(associatedCloud, ccPointCloud), 0, None

    def addPointIndex(self, firstIndex, lastIndex=None):
        self.n_used += 1 if lastIndex is None else need(lastIndex, int) - need(firstIndex, int)
        return True

    def setColor(self, col):
        self.color = need(col, Rgb)

    def setClosed(self, state):
        need(state, bool)


class ccMesh(ccHObject):
    def __init__(self, name):
        super().__init__(name)
        self._vertices, self.color = ccPointCloud(), None

    def getAssociatedCloud(self):
        return self._vertices


class ccGenericPrimitive(ccMesh):
    def __init__(self, name, frame):
        super().__init__(name)
        self.frame = np.eye(4) if frame is None else need(frame, ccGLMatrix).asArray()

    def setColor(self, col):
        self.color = need(col, Rgb)


class ccCone(ccGenericPrimitive):
    def __init__(
        self,
        bottomRadius,
        topRadius,
        height,
        xOff=0.0,
        yOff=0.0,
        transMat=None,
        name="Cone",
    ):
        super().__init__(name, transMat)
        self.radii = need(bottomRadius, float), need(topRadius, float)
        self.height, self.off = need(height, float), (need(xOff, float), need(yOff, float))


class ccCylinder(ccCone):
    def __init__(self, radius, height, transMat=None, name="Cylinder"):
        super().__init__(radius, radius, height, 0.0, 0.0, transMat, name)


class ccSphere(ccGenericPrimitive):
    def __init__(self, radius, transMat=None, name="Sphere"):
        super().__init__(name, transMat)
        self.radius = need(radius, float)


class ccTorus(ccGenericPrimitive):
    def __init__(
        self,
        insideRadius,
        outsideRadius,
        angleRad=2 * np.pi,
        rectangularSection=False,
        rectSectionHeight=0.0,
        transMat=None,
        name="Torus",
    ):
        super().__init__(name, transMat)
        self.inside, self.outside = need(insideRadius, float), need(outsideRadius, float)
        self.angle = need(angleRad, float)
        need(rectangularSection, bool)
        need(rectSectionHeight, float)


class cc2DLabel(ccHObject):
    def __init__(self, name="Label"):
        super().__init__(name)
        self.picked = []

    def addPickedPoint(self, cloud, pointIndex, entityCenter=False):
        need(cloud, ccPointCloud)
        if not 0 <= need(pointIndex, int) < cloud.size():
            raise IndexError("invalid index")
        self.picked.append((cloud, pointIndex))
        return True

    def setCollapsed(self, state):
        need(state, bool)

    def displayPointLegend(self, state):
        need(state, bool)


class ccProgressDialog:
    cancel_after: float | None = None
    """Cancelled once it has shown so many percent; set by tests."""
    shown: list[float] = []  # noqa: RUF012 - the tests look at it

    def __init__(self, cancelButton=False):
        need(cancelButton, bool)
        type(self).shown = []
        self.is_open = False

    def setMethodTitle(self, methodTitle):
        assert threading.current_thread() is threading.main_thread()
        need(methodTitle, str)

    def setInfo(self, infoStr):
        assert threading.current_thread() is threading.main_thread()
        need(infoStr, str)

    def start(self):
        self.is_open = True

    def stop(self):
        self.is_open = False

    def update(self, percent):
        self.shown.append(need(percent, float))
        return True

    def isCancelRequested(self):
        limit = type(self).cancel_after
        return limit is not None and bool(self.shown) and self.shown[-1] >= limit


class ccLog:
    @staticmethod
    def Print(message):
        LOG.append(("print", need(message, str)))

    @staticmethod
    def Warning(message):
        LOG.append(("warning", need(message, str)))

    @staticmethod
    def Error(message):
        LOG.append(("error", need(message, str)))


class ccPythonInstance:
    def __init__(self):
        self.selection, self.db = [], []

    def getSelectedEntities(self):
        return list(self.selection)

    def addToDB(self, obj, updateZoom=False, autoExpandDBTree=True):
        self.db.append(need(obj, ccHObject))

    def redrawAll(self, only2D=False):
        need(only2D, bool)

    def updateUI(self):
        pass


class PythonPluginInterface:
    def __init__(self):
        self.is_initialised = True


class Action:
    def __init__(self, name, target, icon=None):
        self.name, self.target, self.icon = need(name, str), target, need(icon, str, bytes)


def RunInThread(callable, *args, **kwargs):
    """Run in another thread; the runtime keeps nothing of an exception but that there was one."""
    outcome = []

    def work():
        with contextlib.suppress(BaseException):
            outcome.append(callable(*args, **kwargs))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    if not outcome:
        raise RuntimeError("std::exception")
    return outcome[0]


def modules() -> tuple[ModuleType, ModuleType, ccPythonInstance]:
    """Return fresh `pycc` and `cccorelib` modules, and the running CloudCompare."""
    pycc, core, app = ModuleType("pycc"), ModuleType("cccorelib"), ccPythonInstance()
    own = (
        PythonPluginInterface, Action, RunInThread, ccLog, ccProgressDialog, ccHObject,
        ccPointCloud, ccPolyline, ccCylinder, ccCone, ccSphere, ccTorus, cc2DLabel, ccGLMatrix,
        Rgb,
    )  # fmt: skip
    for each in own:
        setattr(pycc, each.__name__, each)
    pycc.GetInstance = lambda: app
    core.CCVector3 = CCVector3
    LOG.clear()
    ccProgressDialog.cancel_after = None
    return pycc, core, app
