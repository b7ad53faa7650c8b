"""Why the impact at a site of a map is doubtful, and what helps."""

from antiosc.base.texts import SMALLER_CELLS, where_to_change

#: Reasons.
CUT = "an edge cuts the patch"
SUPPORTED = "supports hold a part of it"
NEAR = "a support is within two radii of the patch"
EDGE = "an edge or a corner is struck"
HOLLOW = "a hollow is too narrow for the striker"
PIERCED = "the striker pierces the part elsewhere"
NO_RESULT = "the impact has no result"
BEYOND_WALL = "the force exceeds that on a wall"
#: Reason -> what leaves fewer doubtful sites.
REMEDIES = {
    CUT: "take a smaller radius of the patch"
    f" ({where_to_change('[map] radius', 'patch radius')}), on cells not larger than it"
    f" ({SMALLER_CELLS})",
    SUPPORTED: "hold the part elsewhere, or map another face",
    NEAR: "hold the part elsewhere, or map another face",
    EDGE: f"map one face ({where_to_change('[map] where', 'Map face N, after a click on it')})",
    HOLLOW: "take a smaller striker",
    PIERCED: "take a smaller striker",
    BEYOND_WALL: f"take cells smaller than the radius of the patch ({SMALLER_CELLS})",
}
