"""What the law of the grip is made of. grip.c has the same ones by the same names."""

ROUND_S = 0.01
# From a command to the motion that a frame shows: an actuator's lag, of 12 to 50 ms, and a round. Taken for too long, a
# thing seems softer than it is, and is squeezed faster; for too short, stiffer, and is dropped.
LAG_S = 0.05
CLOSING_MM_S = 10.0  # what coasts meanwhile, .5 mm, presses a stiff thing with a newton
STIFFNESS_N_PER_MM = 0.8  # until it is felt: a soft thing behind two skins of 2.5 N/mm each
LEAST_N_PER_MM, MOST_N_PER_MM = 0.2, 3.0  # softer than any thing that is held; stiffer than skin
FELT_MM, FELT_N = 0.3, 0.3  # stiffness is felt once it closed by so much, and pressed by so much more: noise is a tenth

FRICTION = 0.625  # assumed until a slip: the middle of .35 to .9, of skin on things
RESERVE = 1.3  # press that much harder than is needed: a slip is felt where friction is kinetic, .85 of the static
# N/s for each N that is missing; N/s at most; of a change, in a round. Calmly, as jumps shake like slips. In a reflex:
# all that is missing, in a round, as what coasts is counted.
CALM = CALM_PER_S, CALM_N_PER_S, CALM_SHARE = 6.0, 5.0, 0.3
REFLEX = REFLEX_PER_S, REFLEX_N_PER_S, REFLEX_SHARE = 1 / ROUND_S, 40.0, 1.0
RELEASE_N_PER_S = 0.9  # a slip that is missed while it lets go costs a tenth of a newton
NEAR_SHARE, SETTLED_SHARE = 0.05, 0.15  # of what it wants to press: enough, and settled

SLIPS_FROM_COUNTS, PENDING_ROUNDS = 22, 3  # the level of a slip, which a squeeze hardly has; for how long it is awaited
EVENT_ROUNDS = 10  # without a slide, until the next one is another event: skin rings for so long after a knock
LOAD_SHARE = 0.02  # of what is felt, each round: the load that is borne, over half a second
RELIEVED_SHARE = 0.5  # a slip at less of the load than this is not one of a grip that is too light

DOUBT, DOUBT_RESERVE = 0.45, 0.65  # of shear's half width; of what pressed, on top where shear says nothing
INTERVAL_SHARE, MARGIN_SHARE = 0.5, 0.1  # of normal's half width, added to it; of that, each round
BLIND_ROUNDS, BLIND_SHARE = 3, 0.4  # without a frame; how much harder it then presses: things get heavier
BLIND_MARGINS, BLIND_SLIPS = 4, 2  # by so many of its margins, and by that share again for each of so many slips
