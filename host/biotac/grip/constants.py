"""Constants of the grip's law. grip.c has the same ones by the same names."""

ROUND_S = 0.01
# From a command to the motion in a frame: an actuator's lag, 12 to 50 ms, and a round. If it is set too long, a thing
# seems softer than it is and is squeezed faster; if too short, a thing seems stiffer and is dropped.
LAG_S = 0.05
CLOSING_MM_S = 10.0  # the fingers coast 0.5 mm meanwhile, which presses a stiff thing with 1 N
STIFFNESS_N_PER_MM = 0.8  # until it is measured: a soft thing behind two skins of 2.5 N/mm each
LEAST_N_PER_MM, MOST_N_PER_MM = 0.2, 3.0  # softer than any thing that is held; stiffer than skin
FELT_MM, FELT_N = 0.3, 0.3  # stiffness is measured after closing and pressing by this much more; noise is a tenth

FRICTION = 0.625  # assumed until a slip: the middle of 0.35 to 0.9, the range of skin on things
RESERVE = 1.3  # press that much harder than necessary: friction in a slip is kinetic, 0.85 of the static
# N/s for each missing N; most N/s; share of a change that one round takes over. Calm, because jumps shake like slips.
# A reflex adds all that is missing in one round: the motion still to come is already counted.
CALM = CALM_PER_S, CALM_N_PER_S, CALM_SHARE = 6.0, 5.0, 0.3
REFLEX = REFLEX_PER_S, REFLEX_N_PER_S, REFLEX_SHARE = 1 / ROUND_S, 40.0, 1.0
RELEASE_N_PER_S = 0.9  # a slip that is missed in a release costs 0.1 N
NEAR_SHARE, SETTLED_SHARE = 0.05, 0.15  # of the wanted press: enough, and settled

SLIPS_FROM_COUNTS, PENDING_ROUNDS = 22, 3  # level that a squeeze hardly reaches; how long a slip is awaited
EVENT_ROUNDS = 10  # without a slide, until the next one is another event: skin rings this long after a knock
LOAD_SHARE = 0.02  # of the felt load, each round: the borne load is an average over half a second
RELIEVED_SHARE = 0.5  # a slip below this share of the load does not mean that the grip is too light

DOUBT, DOUBT_RESERVE = 0.45, 0.65  # of shear's half width; of the press, added where shear is unknown
INTERVAL_SHARE, MARGIN_SHARE = 0.5, 0.1  # of normal's half width, added to it; of that, each round
BLIND_ROUNDS, BLIND_SHARE = 3, 0.4  # without a frame; how much harder the grip then presses: the load may grow
BLIND_MARGINS, BLIND_SLIPS = 4, 2  # by so many margins, and by that share again for each of so many slips
