"""Operations of usd-core that a script may use to place an object, and violations of the policy in words."""

from typing import Literal

from s2a.core.errors import InputError, printable


class PolicyViolation(InputError):
    """A script was rejected or failed; the stage is unchanged.

    Attributes:
        step: "allowlist" (its text), "process" (it failed or exceeded a limit) or "comparison" (its result differs
            from the plan).
        reason: what is wrong, and what is possible instead.
        line: of the script, from 1; None where no single line is to blame.
    """

    def __init__(
        self, step: Literal["allowlist", "process", "comparison"], reason: str, line: int | None = None
    ) -> None:
        self.step, self.reason, self.line = step, printable(reason), line
        super().__init__(f"script refused ({step}){'' if line is None else f', line {line}'}: {self.reason}")


MODULES = ("Gf", "Kind", "Sdf", "Tf", "Usd", "UsdGeom", "UsdSemantics", "Vt")  # What may be imported from pxr
# What may be imported from elsewhere: functions of numbers, and words for annotations, which cannot be called
OTHERS = {
    "math": tuple(
        "pi tau sqrt sin cos tan asin acos atan atan2 radians degrees hypot floor ceil fabs isclose isfinite isnan".split()
    ),
    "typing": tuple("Any Dict Iterable List Mapping Optional Sequence Tuple Union".split()),
}

# Kinds of nodes in a syntax tree that a script may have
FORMS = (
    "Module Expr Assign AnnAssign AugAssign FunctionDef Return If For With withitem Try ExceptHandler Raise Assert Pass "
    "Break Continue Import ImportFrom alias arguments arg keyword Call Name Attribute Subscript Slice Constant Starred JoinedStr "
    "FormattedValue List Tuple Dict ListComp comprehension IfExp BoolOp And Or UnaryOp USub UAdd Not BinOp Add Sub Mult Div "
    "BitOr Mod Compare Eq NotEq Lt LtE Gt GtE Is IsNot In NotIn Load Store"
).split()

BUILTINS = frozenset(
    "abs bool dict enumerate float int isinstance len list max min print range reversed round set sorted str sum tuple zip "
    "any all Exception RuntimeError ValueError TypeError KeyError AssertionError".split()
)

_VECTORS = " ".join(f"Gf.Vec{n}{kind}" for n in (2, 3, 4) for kind in "dfhi")
_TYPES = (
    "Bool Color3f Double Double2 Double3 Double4 Float Float2 Float3 Float4 Int Matrix4d Quatd Quatf Quath String "
    "StringArray Token TokenArray Vector3d Vector3f Point3f Normal3f DoubleArray FloatArray IntArray Half Half3"
)

# Names below the modules, as values and as functions
DOTTED = frozenset(
    f"{_VECTORS} Gf.Quatd Gf.Quatf Gf.Quath Gf.Quaternion Gf.Matrix3d Gf.Matrix4d Gf.Rotation Gf.Transform "
    "Gf.IsClose Gf.Vec3d.XAxis Gf.Vec3d.YAxis Gf.Vec3d.ZAxis Gf.Normalize Gf.Quatd.GetIdentity Gf.Quatf.GetIdentity "
    "Kind.Tokens.component Kind.Tokens.subcomponent Kind.Tokens.group Kind.Tokens.assembly Kind.Tokens.model "
    "Sdf.Layer Sdf.Layer.FindOrOpen Sdf.Path Sdf.Reference Sdf.LayerOffset Sdf.ChangeBlock "
    "Sdf.PrimSpec Sdf.AttributeSpec Sdf.CreatePrimInLayer Sdf.JustCreatePrimInLayer Sdf.CreatePrimAttributeInLayer "
    "Sdf.SpecifierDef Sdf.SpecifierOver Sdf.VariabilityUniform Sdf.VariabilityVarying "
    f"{' '.join(f'Sdf.ValueTypeNames.{name}' for name in _TYPES.split())} "
    "Tf.ErrorException Tf.MakeValidIdentifier "
    "Usd.Stage Usd.Stage.Open Usd.Prim Usd.Attribute Usd.References Usd.ModelAPI Usd.ModelAPI.Apply "
    "Usd.TimeCode Usd.TimeCode.Default Usd.EditContext Usd.ListPositionBackOfPrependList Usd.ListPositionFrontOfPrependList "
    "Usd.ListPositionBackOfAppendList Usd.ListPositionFrontOfAppendList Usd.SchemaRegistry "
    "UsdGeom.Xform UsdGeom.Xform.Define UsdGeom.Xform.Get UsdGeom.Xformable UsdGeom.Xformable.Get UsdGeom.XformOp "
    "UsdGeom.XformCommonAPI UsdGeom.XformCommonAPI.RotationOrderXYZ UsdGeom.Imageable UsdGeom.Scope UsdGeom.Mesh "
    "UsdGeom.XformOp.PrecisionDouble UsdGeom.XformOp.PrecisionFloat UsdGeom.XformOp.PrecisionHalf "
    "UsdGeom.XformOp.TypeTranslate UsdGeom.XformOp.TypeOrient UsdGeom.XformOp.TypeScale UsdGeom.XformOp.TypeTransform "
    "UsdGeom.Tokens.z UsdGeom.GetStageUpAxis UsdGeom.GetStageMetersPerUnit "
    "UsdSemantics.LabelsAPI UsdSemantics.LabelsAPI.Apply UsdSemantics.LabelsAPI.Get UsdSemantics.LabelsAPI.CanApply "
    "Vt.TokenArray Vt.StringArray Vt.DoubleArray Vt.FloatArray Vt.IntArray".split()
) | {f"{module}.{name}" for module, names in OTHERS.items() for name in names}

# What may follow a dot behind anything else
METHODS = frozenset(
    # of stages, layers and paths
    "GetPrimAtPath GetDefaultPrim DefinePrim OverridePrim GetRootLayer GetEditTarget GetPseudoRoot Traverse Save "
    "GetAttributeAtPath GetObjectAtPath HasDefaultPrim AppendChild AppendPath AppendProperty pathString name path "
    # of prims
    "GetPrim GetPath GetName GetTypeName SetTypeName IsValid IsA HasAPI ApplyAPI AddAppliedSchema SetSpecifier SetMetadata "
    "GetMetadata GetChildren GetAllChildren GetChild GetParent GetStage HasAttribute GetAttribute GetAttributes CreateAttribute "
    "SetKind GetKind GetAppliedSchemas IsDefined IsActive HasAuthoredReferences "
    # of references
    "GetReferences AddReference SetReferences ClearReferences referenceList Prepend prependedItems "
    # of attributes
    "Set Get HasValue HasAuthoredValue GetAttr SetVariability SetCustom IsAuthored default "
    # of transforms
    "AddTranslateOp AddOrientOp AddScaleOp AddTransformOp AddRotateXYZOp AddRotateZOp AddRotateXOp AddRotateYOp AddXformOp "
    "ClearXformOpOrder SetXformOpOrder GetOrderedXformOps GetXformOpOrderAttr MakeMatrixXform GetTranslateOp GetOrientOp "
    "GetScaleOp SetTranslate SetRotate SetScale GetOpName GetOpType GetLocalTransformation ComputeLocalToWorldTransform "
    # of semantic labels
    "CreateLabelsAttr GetLabelsAttr "
    # of vectors, quaternions and matrices
    "SetRotateOnly SetTranslateOnly SetIdentity SetDiagonal GetQuat GetQuaternion GetNormalized Normalize "
    "GetReal GetImaginary GetInverse GetTranspose GetAngle GetAxis SetRow SetRow3 ExtractTranslation ExtractRotation "
    "ExtractRotationQuat GetLength real imaginary "
    # of texts and lists
    "append extend items keys values get format join lower upper strip replace split startswith endswith title "
    # of low-level specs
    "specifier typeName".split()
)

# Which of them are no functions: the others must be called where they stand
PROPERTIES = frozenset(
    "name path pathString real imaginary specifier typeName default referenceList prependedItems".split()
)

# Methods that give numbers, or vectors, quaternions and matrices, whatever they are called on: no text or list has them
NUMERIC = frozenset(
    "SetScale SetRotate SetTranslate SetRotateOnly SetTranslateOnly SetIdentity SetDiagonal SetRow SetRow3 GetInverse "
    "GetTranspose GetNormalized Normalize GetReal GetImaginary GetAngle GetAxis GetLength GetQuat GetQuaternion "
    "ExtractTranslation ExtractRotation ExtractRotationQuat GetLocalTransformation ComputeLocalToWorldTransform".split()
)

STORES = frozenset({"specifier", "typeName", "default"})  # What may be assigned behind a dot

METADATA = frozenset({"kind", "comment", "displayName"})  # What SetMetadata may set

# Operations whose first argument is a file, and which file it has to be
FILES = {
    "Usd.Stage.Open": "stage",
    "Sdf.Layer.FindOrOpen": "stage",
    "Sdf.Reference": "object",
    "AddReference": "object",
    "SetReferences": "object",
    "Prepend": "object",
}

# Methods that a loop may run over: as many as the stage has, or a literal
GROWING = frozenset(
    {"Traverse", "GetChildren", "GetAllChildren", "GetAttributes", "GetOrderedXformOps", "items", "keys", "values"}
)
# Functions that give as many items as they are given
WRAPPING = frozenset({"enumerate", "zip", "sorted", "reversed", "list", "tuple"})
