// Words that leap as no living sensor's do, and blows that are none.
#include "emulated_finger.h"

#include "signal/leap.h"

#define PAC_REST 2040
#define QUIET    16

enum { NONE, TOGETHER = BT_SENSOR_FAULT_TOGETHER, EXCHANGED = BT_SENSOR_FAULT_EXCHANGED };

static bt_leap leap;
static bt_trigger trigger;
static bt_round now;

static uint8_t end_round(int pac_swing)
{
    now.t_us += BT_FRAME_MS * 1000;
    bt_trigger_begin(&trigger, BT_TRIGGER_NEVER);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        bt_trigger_follow(&trigger, i, now.electrode[i]);
    }
    for (unsigned k = 0; k < BT_PAC_PER_FRAME; k++) {
        now.pac[k] = (uint16_t)(PAC_REST + (k % 2 ? pac_swing : 0));
    }
    (void)bt_trigger_pressure(&trigger, now.pdc, INT32_MAX);
    return bt_leap_round(&leap, &now, &trigger);
}

static void begin(int first_swing)
{
    memset(&leap, 0, sizeof leap);
    bt_trigger_reset(&trigger);
    now.pdc = 1500;
    now.tdc = 1000;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        now.electrode[i] = (uint16_t)(2500 + 20 * i);
    }
    for (int k = 0; k < 10; k++) {
        assert_int_equal(end_round(k == 0 ? first_swing : QUIET), NONE);
    }
}

// All electrodes move by `counts`, every `against`th to the other side, the last of them by `more`.
typedef struct {
    const char *name;
    int counts, more;
    unsigned against;
    int pdc, tdc;
    int pac[3]; // the swing in the round before, in the round of the leap, and after
    uint8_t fault;
} leap_case;

static void move(const leap_case *by, int sign)
{
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int size = by->counts + (i + 1 == BT_ELECTRODES ? by->more : 0);
        now.electrode[i] = (uint16_t)(now.electrode[i] + sign * (i % by->against == 1 ? -size : size));
    }
    now.pdc = (uint16_t)(now.pdc + sign * by->pdc);
    now.tdc = (uint16_t)(now.tdc + sign * by->tdc);
}

#define NEVER  99
#define FAINT  75
#define LOUD   76
#define RAILED (BT_RAIL_COUNT - PAC_REST)
#define UNREAD (BT_INVALID_COUNT - PAC_REST)

static const leap_case cases[] = {
    {"all leap while PAC is quiet", 54, 0, 2, -49, 0, {FAINT, FAINT, FAINT}, EXCHANGED},
    {"all leap, PAC at rest", 54, 0, 2, -49, 0, {QUIET, QUIET, QUIET}, EXCHANGED},
    {"pressure leaps less", 59, 0, 2, -25, 0, {QUIET, QUIET, QUIET}, EXCHANGED},
    {"not far enough", 53, 0, 2, -49, 0, {QUIET, QUIET, QUIET}, NONE},
    {"stuck skin snaps back", 200, 0, 2, -24, 0, {QUIET, QUIET, QUIET}, NONE},
    {"a blow heard before", 54, 0, 2, 49, 0, {LOUD, QUIET, QUIET}, NONE},
    {"a blow heard at once", 54, 0, 2, 49, 0, {QUIET, LOUD, QUIET}, NONE},
    {"a blow heard after", 54, 0, 2, 49, 0, {QUIET, QUIET, LOUD}, NONE},
    {"a blow that rails PAC", 200, 0, 2, 200, 0, {QUIET, RAILED, QUIET}, NONE},
    {"PAC not read", 200, 0, 2, 200, 0, {QUIET, UNREAD, QUIET}, NONE},
    {"all move alike, however loud", -50, 0, NEVER, 24, 0, {LOUD, LOUD, LOUD}, TOGETHER},
    {"alike, not far enough", -31, 0, NEVER, 24, 0, {LOUD, LOUD, LOUD}, NONE},
    {"alike, and pressed", -50, 0, NEVER, 25, 0, {LOUD, LOUD, LOUD}, NONE},
    {"one moves twice as far", -50, -60, NEVER, 24, 0, {LOUD, LOUD, LOUD}, NONE},
    {"some the other way", -50, 0, 5, 24, 0, {LOUD, LOUD, LOUD}, NONE},
    {"TDC leaps down, and pressure", 0, 0, NEVER, 13, -65, {LOUD, LOUD, LOUD}, EXCHANGED},
    {"TDC leaps up, and pressure", 0, 0, NEVER, -13, 65, {LOUD, LOUD, LOUD}, EXCHANGED},
    {"TDC leaps, pressure is the same finger's", 0, 0, NEVER, 12, 65, {LOUD, LOUD, LOUD}, TOGETHER},
    {"TDC, not far enough", 0, 0, NEVER, 0, 64, {LOUD, LOUD, LOUD}, NONE},
};

static const leap_case snap = {.counts = 200, .against = 2};

TEST(a_leap_is_told_once_when_later_rounds_confirm_it)
{
    for (unsigned k = 0; k < sizeof cases / sizeof *cases; k++) {
        const leap_case *by = &cases[k];
        int when = by->tdc != 0 ? BT_LEAP_ROUNDS : 2;
        for (int glitch = 0; glitch < 2; glitch++) {
            begin(49);
            assert_int_equal(end_round(by->pac[0]), NONE);
            move(by, 1);
            for (int round = 1; round < 12; round++) {
                move(&snap, round == 6 && glitch ? 1 : 0);
                uint8_t want = round == when && !glitch ? by->fault : NONE;
                if (end_round(round < 3 ? by->pac[round] : QUIET) != want) {
                    fail_msg("%s%s, round %d", by->name, glitch ? ", for one round" : "", round);
                }
                move(by, round == 1 && glitch ? -1 : 0);
            }
        }
    }
}

TEST(what_moved_while_nothing_was_read_or_heard_did_not_leap)
{
    enum { NO_ELECTRODES, NO_PRESSURE, NO_ROUND, PAC_INACTIVE, JUST_STARTED, REASONS };
    for (int why = 0; why < REASONS; why++) {
        begin(why == PAC_INACTIVE ? 48 : 49);
        bt_round before = now;
        if (why == NO_ELECTRODES) {
            memset(now.electrode, 0xFF, sizeof now.electrode);
        }
        now.pdc = why == NO_PRESSURE ? BT_INVALID_COUNT : now.pdc;
        if (why == JUST_STARTED) {
            memset(&leap, 0, sizeof leap);
            leap.pac_active = true;
        }
        (void)end_round(QUIET);
        before.t_us = now.t_us + (why == NO_ROUND ? BT_FRAME_MS * 1000 : 0);
        now = before;
        move(&(leap_case){.counts = 300, .against = 2, .pdc = 300}, 1);
        for (int round = 0; round < 3; round++) {
            if (end_round(QUIET) != NONE) {
                fail_msg("reason %d", why);
            }
        }
    }
}

// `words`: in each round, T: the thermometer leapt, E: electrodes did, B: both, -: neither. `pending`: told
// after each.
static void expect_pending(const leap_case *by, const char *words, const char *pending)
{
    const leap_case tdc = {.tdc = 300, .against = NEVER};
    bool warm = false, moved = false;
    begin(49);
    for (int round = 0; words[round]; round++) {
        bool is_warm = words[round] == 'T' || words[round] == 'B';
        bool is_moved = words[round] == 'E' || words[round] == 'B';
        move(&tdc, is_warm - warm);
        move(by, is_moved - moved);
        warm = is_warm;
        moved = is_moved;
        (void)end_round(QUIET);
        if (leap.pending != (pending[round] == 'p')) {
            fail_msg("%s, round %d", words, round);
        }
    }
}

TEST(a_leap_is_pending_until_it_is_confirmed_or_over)
{
    const leap_case touch = {.counts = 200, .against = 2}, supply = {.counts = -50, .against = NEVER};
    const leap_case exchange = {.counts = 200, .against = 2, .pdc = 200};
    expect_pending(&touch, "-BBBBBBBB--", "-ppppppp---");
    expect_pending(&touch, "-BBB---", "-ppp---");
    expect_pending(&touch, "-BTTT--", "-pppp--");
    expect_pending(&touch, "-TTT--", "------");
    expect_pending(&touch, "-EEE--", "------");
    expect_pending(&supply, "-EEE", "-p--");
    expect_pending(&exchange, "-EEE", "-p--");
}

// TDC's words, W: another temperature's, -: lost. The last is told to be a leap if `leaps`.
static void expect_temperatures(const char *words, bool leaps)
{
    begin(49);
    memset(&leap, 0, sizeof leap);
    for (; *words; words++) {
        now.tdc = *words == 'W' ? 1300 : *words == '-' ? BT_INVALID_COUNT : 1000;
        assert_int_equal(end_round(QUIET), words[1] == 0 && leaps ? TOGETHER : NONE);
    }
}

TEST(a_temperature_leaps_after_eight_rounds_of_another)
{
    expect_temperatures(".........WWWWWWWW", true);
    expect_temperatures(".........WWWWWWW.WWWWWWW", false);
    expect_temperatures("........WWWWWWWWWWWWWWWW", false); // it was not settled
    expect_temperatures("W.........-W.-W.-WW...", false);
    expect_temperatures("..........-.WWWWWWWW", true);
    expect_temperatures(".........--------WWWWWWWWWWWW", false); // too long ago
}
