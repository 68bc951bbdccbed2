"""Scripts that want more than to place an object, with the reason for which each of them must fail.

Every script first places the object as planned (`GOOD`), so that it would be accepted if its attack went unnoticed. In a
script SECRET stands for the path of a file outside the scratch folder, FOLDER for the folder that it lies in, PORT for a
local TCP port that listens, and PARENT for the number of the process that runs the tests.
"""

from __future__ import annotations

from typing import NamedTuple

GOOD = """\
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics
stage = Usd.Stage.Open("scene.usda")
prim = UsdGeom.Xform.Define(stage, "/scene/mug_8").GetPrim()
prim.GetReferences().AddReference("objects/mug.usd")
UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(1.5, -0.25, 0.75))
prim.CreateAttribute("s2a:partId", Sdf.ValueTypeNames.String).Set("mug_8")
prim.CreateAttribute("s2a:label", Sdf.ValueTypeNames.String).Set("coffee mug")
UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr(["coffee mug"])
stage.Save()
"""


class Hostile(NamedTuple):
    """An attack.

    Attributes:
        attack: what follows after `GOOD`.
        allowlist: part of the reason for which its text is refused.
        process: part of the reason for which it fails where its text is not looked at; "" where it has no effect; None
            where that is not tried, since the text alone is what is wrong.
    """

    attack: str
    allowlist: str
    process: str | None


NO_FILE, NO_CALL, NO_MODULE = "No such file", "not permitted", "No module named"

FILES = {
    "read": Hostile("raise RuntimeError(open('SECRET').read())", "'open' is neither", NO_FILE),
    "read through io": Hostile("import io\nraise RuntimeError(io.FileIO('SECRET').read())", "Import is not", NO_FILE),
    "read through posix": Hostile("import posix\nposix.open('SECRET', 0)", "Import is not", NO_FILE),
    "read below the root": Hostile("open('/etc/passwd').read()", "'open' is neither", NO_FILE),
    "read by climbing": Hostile("open('../../../../../../../../etc/passwd').read()", "'open' is neither", NO_FILE),
    "read /proc": Hostile("open('/proc/self/environ').read()", "'open' is neither", NO_FILE),
    "read the program": Hostile("open(s2a.__file__)\n", "begins with an underscore", "NameError"),
    "overwrite": Hostile("open('SECRET', 'w').write('gone')", "'open' is neither", NO_FILE),
    "append": Hostile("open('SECRET', 'a').write('more')", "'open' is neither", NO_FILE),
    "delete": Hostile("import os\nos.unlink('SECRET')", "Import is not", NO_FILE),
    "rename": Hostile("import os\nos.rename('SECRET', 'mine')", "Import is not", NO_FILE),
    "permit": Hostile("import os\nos.chmod('SECRET', 0o777)", "Import is not", ""),
    "permit by descriptor": Hostile(
        "import os\nos.fchmod(os.open('scene.usda', 0), 0)\nos.chmod('FOLDER', 0)", "Import is not", ""
    ),
    "permit by system call": Hostile(
        "import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\nlibc.fchmodat(-100, b'SECRET', 0o777, 0)\n"
        "if libc.syscall(452, -100, b'SECRET', 0o777, 0) < 0:\n    raise OSError(ctypes.get_errno(), 'not permitted')",
        "Import is not",
        NO_CALL,
    ),
    "own": Hostile("import os\nos.chown('SECRET', 1, 1)", "Import is not", NO_CALL),
    "set times": Hostile("import os\nos.utime('SECRET', (0, 0))", "Import is not", NO_CALL),
    "truncate": Hostile("import os\nos.truncate('SECRET', 0)", "Import is not", NO_CALL + "|" + NO_FILE),
    "drop a file beside": Hostile("open('FOLDER/dropped', 'w')", "'open' is neither", NO_FILE),
    "list": Hostile("import os\nos.listdir('FOLDER')", "Import is not", NO_FILE),
    "link": Hostile("import os\nos.link('SECRET', 'mine')", "Import is not", NO_CALL),
    "symbolic link": Hostile("import os\nos.symlink('SECRET', 'mine')", "Import is not", NO_CALL),
    "save through a link": Hostile(
        "import os\nos.unlink('scene.usda')\nos.symlink('SECRET', 'scene.usda')", "Import is not", NO_CALL
    ),
    "change root": Hostile("import os\nos.chroot('.')", "Import is not", NO_CALL),
    "make a device": Hostile("import os\nos.mknod('disk', 0o060600, 0x0800)", "Import is not", NO_CALL),
    "make a pipe file": Hostile(
        "import os\nos.unlink('scene.usda')\nos.mkfifo('scene.usda')", "Import is not", NO_CALL
    ),
    "mount": Hostile(
        "import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\n"
        "if libc.mount(b'none', b'.', b'tmpfs', 0, None):\n    raise OSError(ctypes.get_errno(), 'not permitted')",
        "Import is not",
        NO_CALL,
    ),
    "delete the stage": Hostile(
        "import os\nos.unlink('scene.usda')", "Import is not", "report cannot be read|was ended"
    ),
    "rewrite the stage": Hostile("open('scene.usda', 'w').write('nothing')", "'open' is neither", "not USD text"),
    "binary stage": Hostile(
        "stage.GetRootLayer().Export('x.usdc')\nopen('scene.usda', 'wb').write(open('x.usdc', 'rb').read())",
        "'Export' is not among",
        "not USD text",
    ),
    "read through linecache": Hostile(
        "import linecache\nraise RuntimeError(linecache.getlines('SECRET') or 'nothing')", "Import is not", "nothing"
    ),
}

USD = {
    "Stage.Export": Hostile("stage.Export('FOLDER/out.usda')", "'Export' is not among", "ErrorException"),
    "Layer.Export": Hostile("stage.GetRootLayer().Export('FOLDER/o.usda')", "'Export' is not among", "ErrorException"),
    "Stage.CreateNew": Hostile(
        "Usd.Stage.CreateNew('FOLDER/new.usda')", "Usd.Stage.CreateNew is not", "ErrorException"
    ),
    "Layer.CreateNew": Hostile("Sdf.Layer.CreateNew('FOLDER/new.usda').Save()", "Sdf.Layer.CreateNew is not", "Error"),
    "Stage.Open elsewhere": Hostile("Usd.Stage.Open('FOLDER/other.usda')", "is given", "ErrorException"),
    "Stage.Open with a keyword": Hostile("Usd.Stage.Open(filePath='FOLDER/other.usda')", "is given", "ErrorException"),
    "Stage.Open by climbing": Hostile("Usd.Stage.Open('../../other.usda')", "is given", "ErrorException"),
    "Stage.Open of a sum": Hostile("Usd.Stage.Open('FOLDER' + '/other.usda')", "is given", "ErrorException"),
    "Stage.Open of a name": Hostile(
        "def other(path):\n    return Usd.Stage.Open(path)\nother('scene.usda')\nother('FOLDER/other.usda')",
        "is given",
        "ErrorException",
    ),
    "Stage.Open of the unknown": Hostile(
        "Usd.Stage.Open(prim.GetAttribute('s2a:label').Get())", "does not follow from the text", "ErrorException"
    ),
    "Stage.Open under another name": Hostile(
        "S = Usd.Stage\nS.Open('FOLDER/other.usda')", "'Open' is not", "ErrorException"
    ),
    "Layer.FindOrOpen elsewhere": Hostile(
        "raise RuntimeError(str(Sdf.Layer.FindOrOpen('FOLDER/other.usda')))", "is given", "None"
    ),
    "Layer.Import": Hostile("stage.GetRootLayer().Import('FOLDER/other.usda')", "'Import' is not", ""),
    "ImportFromString": Hostile(
        "stage.GetRootLayer().ImportFromString('#usda 1.0')\nstage.Save()", "'ImportFromString' is not", "is missing"
    ),
    "sublayer": Hostile(
        "stage.GetRootLayer().subLayerPaths.append('FOLDER/other.usda')\nstage.Save()",
        "'subLayerPaths' is not",
        "adds 'subLayer",
    ),
    "identifier": Hostile(
        "stage.GetRootLayer().identifier = 'FOLDER/moved.usda'\nstage.Save()", "may not be assigned", "Error"
    ),
    "reference elsewhere": Hostile(
        "prim.GetReferences().AddReference('FOLDER/other.usda')\nstage.Save()", "is given", "references"
    ),
    "reference by Sdf": Hostile(
        "prim.GetReferences().AddReference(Sdf.Reference('/etc/passwd'))\nstage.Save()", "is given", "references"
    ),
    "reference in a list": Hostile(
        "prim.GetReferences().SetReferences([Sdf.Reference('objects/mug.usd'), Sdf.Reference('/x.usd')])\nstage.Save()",
        "is given",
        "references",
    ),
    "reference with a keyword": Hostile(
        "prim.GetReferences().AddReference(assetPath='http://host/x.usd')\nstage.Save()", "is given", "references"
    ),
    "reference to another prim": Hostile(
        "prim.GetReferences().AddInternalReference('/scene/wall_1')\nstage.Save()",
        "'AddInternalReference'",
        "references",
    ),
    "payload": Hostile("prim.GetPayloads().AddPayload('FOLDER/other.usda')\nstage.Save()", "Payload", "'payload'"),
    "variants": Hostile(
        "prim.GetVariantSets().AddVariantSet('v').AddVariant('a')\nstage.Save()", "is not among", "'variantSet"
    ),
    "inherit": Hostile(
        "prim.GetInherits().AddInherit('/scene/wall_1')\nstage.Save()", "is not among", "'inheritPaths'"
    ),
    "value clips": Hostile(
        "Usd.ClipsAPI(prim).SetClipAssetPaths([Sdf.AssetPath('FOLDER/other.usda')])\nstage.Save()",
        "is not among",
        "'clips'",
    ),
    "asset attribute": Hostile(
        "prim.CreateAttribute('icon', Sdf.ValueTypeNames.Asset).Set('SECRET')\nstage.Save()", "is not among", "'icon'"
    ),
    "resolver": Hostile("from pxr import Ar\nAr.GetResolver().Resolve('SECRET')", "Ar may not", ""),
    "resolver opens": Hostile(
        "from pxr import Ar\nraise RuntimeError(str(Ar.GetResolver().OpenAsset(Ar.ResolvedPath('SECRET'))))",
        "Ar may not",
        "None",
    ),
    "plugins": Hostile("from pxr import Plug\nPlug.Registry().RegisterPlugins('FOLDER')", "Plug may not", ""),
    "work threads": Hostile("from pxr import Work\nWork.SetMaximumConcurrencyLimit()", "Work may not", ""),
    "delete another prim": Hostile("stage.RemovePrim('/scene/wall_1')\nstage.Save()", "'RemovePrim' is not", "removes"),
    "deactivate another prim": Hostile(
        "stage.GetPrimAtPath('/scene/wall_1').SetActive(False)\nstage.Save()", "'SetActive' is not", "adds 'active'"
    ),
    "move another prim": Hostile(
        "UsdGeom.Xformable(stage.GetPrimAtPath('/scene/wall_1')).AddTranslateOp().Set(Gf.Vec3d(1, 0, 0))\nstage.Save()",
        "",
        "/scene/wall_1",
    ),
    "relabel another prim": Hostile(
        "stage.GetPrimAtPath('/scene/wall_1').GetAttribute('s2a:label').Set('door')\nstage.Save()",
        "",
        "changes 'default'",
    ),
    "add a second prim": Hostile("stage.DefinePrim('/scene/spy', 'Xform')\nstage.Save()", "", "/scene/spy"),
    "add a child": Hostile("stage.DefinePrim('/scene/mug_8/spy', 'Camera')\nstage.Save()", "", "no children"),
    "another root": Hostile("stage.DefinePrim('/spy', 'Xform')\nstage.Save()", "", "/spy"),
    "another default prim": Hostile(
        "stage.SetDefaultPrim(prim)\nstage.Save()", "'SetDefaultPrim' is not", "'defaultPrim'"
    ),
    "another unit": Hostile(
        "UsdGeom.SetStageMetersPerUnit(stage, 0.01)\nstage.Save()", "is not among", "'metersPerUnit'"
    ),
    "another pose": Hostile(
        "prim.GetAttribute('xformOp:translate').Set(Gf.Vec3d(1.5, -0.25, 0.76))\nstage.Save()",
        "",
        "position is off by 0.01",
    ),
    "moving later": Hostile(
        "prim.GetAttribute('xformOp:translate').Set(Gf.Vec3d(9, 9, 9), 2.0)\nstage.Save()", "", "'timeSamples'"
    ),
    "not a number": Hostile(
        "x = float('nan')\nprim.GetAttribute('xformOp:translate').Set(Gf.Vec3d(x, x, x))\nstage.Save()",
        "",
        "is off by nan",
    ),
    "another label": Hostile("prim.GetAttribute('s2a:label').Set('knife')\nstage.Save()", "", "s2a:label is 'knife'"),
    "instanceable": Hostile("prim.SetInstanceable(True)\nstage.Save()", "'SetInstanceable' is not", "'instanceable'"),
    "hidden note": Hostile("prim.SetCustomDataByKey('note', 'x' * 1000)\nstage.Save()", "", "'customData'"),
    "metadata": Hostile("prim.SetMetadata('active', False)\nstage.Save()", "SetMetadata only of", "'active'"),
    "metadata by something else": Hostile("prim.SetMetadata({}, 1)", "SetMetadata only of", "ArgumentError"),
    "rigid body": Hostile("prim.AddAppliedSchema('PhysicsRigidBodyAPI')\nstage.Save()", "", "no other schema"),
}

NETWORK = {
    "socket": Hostile("import _socket\n_socket.socket()", "Import is not", NO_MODULE + "|not permitted"),
    "connect by system call": Hostile(
        "import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\n"
        "if libc.socket(2, 1, 0) < 0:\n    raise OSError(ctypes.get_errno(), 'not permitted')",
        "Import is not",
        NO_CALL,
    ),
    "datagram": Hostile(
        "import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\n"
        "if libc.socket(2, 2, 0) < 0:\n    raise OSError(ctypes.get_errno(), 'not permitted')",
        "Import is not",
        NO_CALL,
    ),
    "download": Hostile("from urllib.request import urlopen\nurlopen('http://127.0.0.1:PORT')", "urllib", NO_MODULE),
    "ring of calls": Hostile(
        "import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\n"
        "if libc.syscall(425, 8, ctypes.create_string_buffer(256)) < 0:\n    raise OSError(ctypes.get_errno(), 'not permitted')",
        "Import is not",
        NO_CALL,
    ),
}

PROCESSES = {
    "fork": Hostile("import os\nos.fork()", "Import is not", NO_CALL),
    "system": Hostile(
        "import os\nif os.system('touch FOLDER/x'):\n    raise OSError('not permitted')", "Import is not", NO_CALL
    ),
    "exec": Hostile("import os\nos.execv('/bin/sh', ['sh'])", "Import is not", "not permitted|No such file"),
    "spawn": Hostile("import os\nos.posix_spawn('/bin/sh', ['sh'], {})", "Import is not", "not permitted|No such file"),
    "subprocess": Hostile("import subprocess\nsubprocess.run(['id'])", "Import is not", NO_MODULE),
    "thread": Hostile("import _thread\n_thread.start_new_thread(print, ())", "Import is not", "can't start new thread"),
    "kill": Hostile("import os\nos.kill(PARENT, 9)", "Import is not", NO_CALL),
    "signal by file": Hostile(
        "import fcntl\nfcntl.fcntl(1, fcntl.F_SETOWN, PARENT)", "Import is not", NO_MODULE + "|permitted"
    ),
    "trace": Hostile(
        "import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\n"
        "if libc.ptrace(16, PARENT, 0, 0) < 0:\n    raise OSError(ctypes.get_errno(), 'not permitted')",
        "Import is not",
        NO_CALL,
    ),
    "machine code": Hostile("import mmap\nmmap.mmap(-1, 4096, prot=7)", "Import is not", NO_MODULE + "|permitted"),
    "unlock": Hostile(
        "import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\n"
        "if libc.setns(0, 0) < 0 and libc.unshare(0x10000000) < 0:\n    raise OSError(ctypes.get_errno(), 'not permitted')",
        "Import is not",
        NO_CALL,
    ),
    "raise a limit": Hostile(
        "import resource\nresource.setrlimit(resource.RLIMIT_AS, (-1, -1))",
        "Import is not",
        "not permitted|exceeds|not allowed",
    ),
    "leave early": Hostile("import os\nos._exit(0)", "Import is not", "was ended"),
    "forge the report": Hostile(
        'import os\nfor n in range(3, 20):\n    try:\n        os.write(n, b\'{"active": ["forged"]}\\n{}\\n\')\n'
        "    except OSError:\n        pass\nos._exit(0)",
        "Import is not",
        "not USD text|cannot be read|was ended",
    ),
    "abort": Hostile("import os\nos.abort()", "Import is not", "was ended"),
    "crash": Hostile("import ctypes\nctypes.string_at(0)", "Import is not", "was ended"),
    "exit": Hostile("raise SystemExit(0)", "'SystemExit' is neither", "SystemExit"),
}

BOMBS = {
    "endless loop": Hostile("while True:\n    pass", "While is not", "was ended|longer than"),
    "long loop": Hostile("for i in range(10**12):\n    pass", "Pow is not", "was ended|longer than"),
    "long loop, written out": Hostile("for i in range(1000000):\n    x = i", "number of rounds", None),
    "loop over itself": Hostile("x = [1]\nfor i in x:\n    x.append(i)", "", "MemoryError|was ended"),
    "loops in loops": Hostile(
        "for a in range(99):\n for b in range(99):\n  for c in range(99):\n   for d in range(99):\n    pass",
        "loops inside",
        None,
    ),
    "huge number": Hostile("x = 9 ** 9 ** 9 ** 9", "Pow is not", "was ended|longer than|MemoryError"),
    "huge shift": Hostile("x = 1 << (1 << 40)", "LShift is not", "MemoryError|OverflowError|was ended"),
    "huge text": Hostile("x = 'a' * 10000000000", "may be multiplied|number beyond", "MemoryError"),
    "huge width": Hostile("x = f'{1:>9999999999}'", "width", "MemoryError|ValueError"),
    "huge list": Hostile("x = [0] * 9999999999", "may be multiplied|number beyond", "MemoryError"),
    "huge array": Hostile("x = Vt.IntArray(999999999)", "number beyond", None),
    "doubling": Hostile("x = ['a']\nfor i in range(99):\n    x.extend(x)", "", "MemoryError"),
    "recursion": Hostile("def f(n):\n    return f(n)\nf(1)", "by itself", "RecursionError"),
    "mutual recursion": Hostile(
        "def f(n):\n    return g(n)\ndef g(n):\n    return f(n)\nf(1)", "before it is", "RecursionError"
    ),
    "nesting": Hostile("x = " + "[" * 190 + "]" * 190, "nested too deeply|not Python", None),
    "big file": Hostile("open('x', 'wb').write(b'0' * 100_000_000)", "type bytes", "space|large|MemoryError"),
    "many files": Hostile(
        "for i in range(9999):\n    open(str(i), 'w').write('0')", "number of rounds", "space|Disk quota|was ended"
    ),
    "many large files": Hostile(
        "for i in range(50):\n    open(str(i), 'wb').write(b'0' * 1000000)", "type bytes", "space|was ended"
    ),
    "sleep": Hostile("import time\ntime.sleep(3600)", "Import is not", "longer than"),
    "deep stage": Hostile(
        "open('scene.usda', 'w').write('#usda 1.0\\n(' + 'customLayerData = {' + 'dictionary a = {' * 20000)",
        "may be multiplied",
        "not USD text",
    ),
    "endless output": Hostile(
        "import os\nwhile True:\n    os.write(1, b'0' * 65536)", "Import is not", "too large|was ended"
    ),
    "long script": Hostile("#" * 30000, "characters long", None),
    "numbers in a ring": Hostile("a = 1\nb = a * 2\na = b * 2\nc = a * b", "only numbers may be multiplied", None),
    "list of a range": Hostile("x = list(range(900000))", "range that is not known", ""),
    "deep sum": Hostile("if " + "+".join("1" * 3000) + ":\n    pass", "nested too deeply|not Python", None),
    "texts in a ring": Hostile("a = 'x'\nb = a\na = b\nUsd.Stage.Open(a)", "does not follow from the text", None),
    "a chain of names": Hostile(
        "x0 = 'x'\n" + "".join(f"x{i + 1} = x{i}\n" for i in range(900)), "too entangled", None
    ),
    "texts of texts": Hostile(
        "x0 = 'xx'\n" + "".join(f"x{i + 1} = x{i} + x{i}\n" for i in range(60)), "too entangled", None
    ),
    "many prims": Hostile(
        "for i in range(100000):\n    stage.DefinePrim(f'/a/b{i}')\nstage.Save()", "number of rounds", None
    ),
}

LANGUAGE = {
    "eval": Hostile("eval('1')", "'eval' is neither", None),
    "exec of text": Hostile("exec('import os')", "'exec' is neither", None),
    "compile": Hostile("compile('1', 'x', 'eval')", "'compile' is neither", None),
    "__import__": Hostile("__import__('os').fork()", "begins with an underscore", NO_CALL),
    "builtins": Hostile("__builtins__['open']('SECRET')", "begins with an underscore", "No such|subscriptable"),
    "getattr": Hostile("getattr(stage, 'Exp' + 'ort')('FOLDER/x.usda')", "'getattr' is neither", "ErrorException"),
    "globals": Hostile("globals()['stage'] = None", "cannot be assigned", ""),
    "vars": Hostile("vars(prim)", "'vars' is neither", ""),
    "subclasses": Hostile(
        "for c in ().__class__.__base__.__subclasses__():\n    if c.__name__ == 'Popen': c(['id'])", "underscore", ""
    ),
    "dunder by sum": Hostile("x = '__cla' + 'ss__'", "spells a name", None),
    "dunder by sum of names": Hostile("a = '_'\nx = a + a + 'class' + a + a", "spells a name", None),
    "dunder by escape": Hostile("x = '\\x5f\\x5fclass\\x5f\\x5f'", "spells a name", None),
    "dunder by unicode name": Hostile("x = '\\N{LOW LINE}\\N{LOW LINE}class'", "spells a name", None),
    "dunder by f-string": Hostile("u = '__'\nx = f'{u}class'", "spells a name", None),
    "dunder by %": Hostile("x = '%s%sdict' % ('_', '_')", "spells a name", None),
    "dunder by join": Hostile("x = '_'.join(['', '', 'class'])", "spells a name", None),
    "dunder by replace": Hostile("x = '--class--'.replace('-', '_')", "spells a name", None),
    "dunder by format": Hostile("x = '{}{}class'.format('_', '_')", "spells a name", None),
    "hidden method in wide letters": Hostile("x = prim._\uff43lass", "begins with an underscore", None),
    "file put into a list": Hostile(
        "x = ['scene.usda']\nx.append('FOLDER/other.usda')\nUsd.Stage.Open(x[-1])", "does not follow", "ErrorException"
    ),
    "file put into a list under another name": Hostile(
        "x = ['scene.usda']\ny = x\ny += ['FOLDER/other.usda']\nUsd.Stage.Open(x[-1])",
        "does not follow",
        "ErrorException",
    ),
    "item replaced": Hostile(
        "x = ['scene.usda']\nx[0] = 'FOLDER/other.usda'\nUsd.Stage.Open(x[0])", "cannot be assigned", "ErrorException"
    ),
    "keys for items": Hostile(
        "a, b, c = {0: '', 'FOLDER/other.usda': '', 1: 'scene.usda'}\nUsd.Stage.Open(b)", "is given", "ErrorException"
    ),
    "a module's name for another": Hostile(
        "from pxr import Sdf as A\nfrom pxr import Usd as A\nA.Layer.CreateNew('FOLDER/x.usda')", "is not among", None
    ),
    "function as data": Hostile(
        "def o(p):\n    return Usd.Stage.Open(p)\no('scene.usda')\nfor x in sorted(['/x'], key=o):\n    pass",
        "only be called",
        None,
    ),
    "dunder in wide letters": Hostile("x = prim.\uff3f\uff3fclass\uff3f\uff3f", "not Python", None),
    "open in wide letters": Hostile("\uff4f\uff50\uff45\uff4e('SECRET')", "'open' is neither", NO_FILE),
    "walk by format": Hostile("x = '{0.__class__}'.format(prim)", "spells a name", None),
    "walk by format, hidden": Hostile("x = '{0.real}'.format(1)", "without looking into them", None),
    "walk by a format from elsewhere": Hostile(
        "t = prim.GetName()\nx = t.format(stage)", "only with texts that are written out", None
    ),
    "walk by format_map": Hostile("x = '{a}'.format_map({'a': 1})", "'format_map' is not", None),
    "encoding declared": Hostile(
        "# -*- coding: utf-7 -*-\n+AG8AcABlAG4-('SECRET')", "'AG8AcABlAG4' is neither", "NameError"
    ),
    "encoding decoded": Hostile("import codecs\nexec(codecs.decode('vzcbeg bf', 'rot13'))", "Import is not", None),
    "bytes": Hostile("x = b'abc'", "constant of type bytes", None),
    "lambda": Hostile("f = lambda: 1", "Lambda is not", None),
    "class": Hostile("class A:\n    pass", "ClassDef is not", None),
    "decorator": Hostile("@print\ndef f():\n    pass", "decorated", None),
    "star import": Hostile("from pxr.Usd import *", "may not be imported", None),
    "import below pxr": Hostile("from pxr.Tf import sys", "may not be imported", None),
    "import of os under pxr": Hostile("from pxr import os", "os may not be imported", "ImportError"),
    "relative import": Hostile("from . import pxr", "may not be imported", None),
    "the modules that are there": Hostile("Sdf.sys.modules['os'].fork()", "is not among", None),
    "renamed builtin": Hostile("str = Usd.Stage.Open\nstr('FOLDER/other.usda')", "already means something else", None),
    "renamed module": Hostile("Gf = stage\nGf.Export('FOLDER/x.usda')", "already means something else", None),
    "called from a list": Hostile("[Usd.Stage.Open][0]('FOLDER/other.usda')", "only be called", "ErrorException"),
    "called by another name": Hostile("f = Usd.Stage.Open\nf('FOLDER/other.usda')", "only be called", "ErrorException"),
    "given to sorted": Hostile(
        "for x in sorted(['FOLDER/other.usda'], key=Usd.Stage.Open):\n    pass", "only be called", "ErrorException"
    ),
    "match class": Hostile("match prim:\n    case object(__class__=c):\n        pass", "Match is not", None),
    "traceback": Hostile(
        "try:\n    1 / 0\nexcept Exception as e:\n    e.with_traceback(None)", "'with_traceback' is not", None
    ),
    "global": Hostile("def f():\n    global stage\n    stage = 1\nf()", "Global is not", None),
    "delete a name": Hostile("del Usd", "Del is not", ""),
    "asynchronous": Hostile("async def f():\n    pass", "AsyncFunctionDef is not", None),
    "pickle": Hostile(
        "import pickle\npickle.loads(b'cos\\nfork\\n(tR.')", "Import is not", NO_MODULE + "|not permitted"
    ),
    "marshal": Hostile("import marshal\nmarshal.loads(b'')", "Import is not", "EOFError"),
    "zero byte": Hostile("x = 'a\\0b'", "zero byte", None),
    "debugger": Hostile("breakpoint()", "'breakpoint' is neither", ""),
    "input": Hostile("input()", "'input' is neither", "EOFError"),
}

ALL: dict[str, Hostile] = {**FILES, **USD, **NETWORK, **PROCESSES, **BOMBS, **LANGUAGE}
