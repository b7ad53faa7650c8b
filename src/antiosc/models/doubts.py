"""Why the impact at a site of a map is doubtful, and what helps."""

from antiosc.base.texts import SMALLER_CELLS

#: Reasons.
CUT = "an edge cuts the patch"
NEAR = "a support is within two radii of the patch"
EDGE = "an edge or a corner is struck"
HOLLOW = "a hollow is too narrow for the striker"
PIERCED = "the striker pierces the part elsewhere"
NO_RESULT = "the impact has no result"
BEYOND_WALL = "the force exceeds that on a wall"
#: Reason -> what leaves fewer doubtful sites.
REMEDIES = {
    CUT: f"take a smaller radius of the patch, on cells not larger than it ({SMALLER_CELLS})",
    NEAR: "hold the part elsewhere, or map another face",
    EDGE: "map one face (where)",
    HOLLOW: "take a smaller striker",
    PIERCED: "take a smaller striker",
    BEYOND_WALL: f"take cells smaller than the radius of the patch ({SMALLER_CELLS})",
}
