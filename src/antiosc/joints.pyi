# Names of this module, for type checkers and for the module itself.

from antiosc.fem.assembly.joints import (
    Ball as Ball,
    Bolt as Bolt,
    Bushing as Bushing,
    Equation as Equation,
    Hinge as Hinge,
    Mean as Mean,
    Rigid as Rigid,
    Slider as Slider,
    Weld as Weld,
)
from antiosc.fem.assembly.tie import Tie as Tie
from antiosc.fem.structure.attachments import (
    Damper as Damper,
    PointMass as PointMass,
    Spring as Spring,
)
