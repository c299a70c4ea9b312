#include "skin/read.h"

#include <math.h>
#include <string.h>

static const double round_s = BT_SLOTS / (double)BT_SLOT_HZ;
static const double two_pi = 6.283185307179586;

// The state of a round while it is read.
typedef struct {
    const bt_sampling *sampling;
    const bt_skin_finger *finger;
    const bt_effects *effects; // at the ends of the pieces
    int32_t pieces;
    int64_t number;
    bt_lag begin_creep[BT_ELECTRODES], begin_undershoot, begin_pressure_creep; // as it begins
    const bt_reader *end;                                                      // as it ends
} round_now;

// As it begins (0), or at the end of so many pieces.
static const bt_effects *effects_at(const round_now *now, int32_t piece)
{
    return piece == 0 ? &now->end->before : &now->effects[piece - 1];
}

// The lag at the next boundary.
static void follow(bt_lag *lag, double seconds, double value)
{
    if (lag->keep == 0) {
        lag->keep = exp(-round_s / seconds);
    }
    lag->value = lag->keep * lag->value + (1 - lag->keep) * value;
}

static void follow_all(bt_reader *reader, const bt_sampling *sampling, const bt_effects *effects)
{
    for (int e = 0; e < BT_ELECTRODES; e++) {
        follow(&reader->creep[e], sampling->creep_s, effects->pressed[e]);
    }
    follow(&reader->undershoot, sampling->pdc_undershoot_s, effects->pressure);
    follow(&reader->pressure_creep, sampling->pdc_creep_s, effects->pressure);
}

static double between(double begin, double end, double share)
{
    return begin * (1 - share) + end * share;
}

// A lag at the end of so many pieces: straight from round to round.
static double within(const round_now *now, bt_lag begin, bt_lag end, int32_t piece)
{
    return between(begin.value, end.value, piece / (double)now->pieces);
}

// Counts of an electrode at the end of so many pieces, without noise.
static double electrode_at(const round_now *now, int e, int32_t piece)
{
    const bt_skin_finger *finger = now->finger;
    double crept = within(now, now->begin_creep[e], now->end->creep[e], piece);
    double elapsed_s = ((double)now->number + piece / (double)now->pieces) * round_s;
    return effects_at(now, piece)->exact[e] + finger->creep_share * crept
           + finger->drift_per_min[e] / 60 * elapsed_s;
}

// Static pressure above rest, in counts: load, undershoot and creep.
static double pressure_at(const round_now *now, int32_t piece)
{
    const bt_sampling *s = now->sampling;
    double lag = within(now, now->begin_undershoot, now->end->undershoot, piece);
    double low = s->pdc_undershoot * tanh(lag / s->pdc_undershoot_at);
    double creep = within(now, now->begin_pressure_creep, now->end->pressure_creep, piece);
    return effects_at(now, piece)->pressure - low + s->pdc_creep_share * creep;
}

static double slot_value(const round_now *now, int slot, int channel)
{
    double way = slot / (double)BT_SLOTS * now->pieces;
    int32_t piece = (int32_t)way;
    double share = way - piece;
    switch (channel) {
    case BT_CHANNEL_PDC:
        return between(now->finger->pdc_rest + pressure_at(now, piece),
                       now->finger->pdc_rest + pressure_at(now, piece + 1), share);
    case BT_CHANNEL_TAC:
        return now->sampling->tac_rest;
    case BT_CHANNEL_TDC:
        return between(effects_at(now, piece)->tdc, effects_at(now, piece + 1)->tdc, share);
    default:
        return between(electrode_at(now, channel - BT_CHANNEL_E1, piece),
                       electrode_at(now, channel - BT_CHANNEL_E1, piece + 1), share);
    }
}

// PAC: the pressure through a high-pass, and noise that changes of force add to.
static void read_pac(const round_now *now, double *ramp, const double *normal, double *pac)
{
    const bt_sampling *s = now->sampling;
    const double high_pass_s = 1 / (two_pi * s->pac_high_pass_hz), piece_s = round_s / now->pieces;
    const double keep = exp(-piece_s / high_pass_s);
    double before = s->pac_per_pdc * pressure_at(now, 0);
    int slot = 0;
    for (int32_t piece = 0; piece < now->pieces; piece++) {
        double after = s->pac_per_pdc * pressure_at(now, piece + 1);
        double settled = (after - before) / piece_s * high_pass_s; // the answer to an endless ramp
        double newtons = fabs(effects_at(now, piece + 1)->force_n - effects_at(now, piece)->force_n);
        double rattle = now->finger->rattle_per_n_s * newtons * now->pieces / round_s;
        for (; slot < BT_SLOTS && (int64_t)slot * now->pieces / BT_SLOTS == piece; slot++) {
            if (bt_slot_channel[slot] == BT_CHANNEL_PAC) {
                double decay = exp(-(slot / (double)BT_SLOT_HZ - piece * piece_s) / high_pass_s);
                double noise = *normal++ * (s->pac_noise + rattle);
                *pac++ += s->pac_rest + (settled + (*ramp - settled) * decay) + noise;
            }
        }
        *ramp = keep * *ramp + (1 - keep) * settled;
        before = after;
    }
}

// A glitch: how much an electrode's one word is too low. There are never two in a row.
static double glitch(uint8_t *glitched, double share, const double draw[2])
{
    uint8_t hit = draw[0] < share, before = *glitched;
    *glitched = hit;
    return hit && !before ? 30 + 36 * draw[1] : 0;
}

static uint16_t word(double counts)
{
    return (uint16_t)fmin(fmax(rint(counts), 0), BT_FULL_SCALE_COUNT);
}

static void read_round(bt_reader *reader, const round_now *now, const bt_drawn *noise, uint16_t *words)
{
    const bt_sampling *s = now->sampling;
    const double *electrodes = noise->electrodes + noise->next * BT_ELECTRODES,
                 *slow = noise->slow + noise->next * 3;
    const double *glitches = noise->glitches + noise->next * BT_ELECTRODES * 2;
    const double slow_noise[3] = {s->pdc_noise, s->tac_noise, s->tdc_noise};
    double pac[BT_PAC_PER_FRAME];
    bt_ring(reader->ringing, 1, &effects_at(now, 0)->slip_mm_s,
            noise->slips + noise->next * BT_PAC_PER_FRAME * 2, pac);
    read_pac(now, &reader->ramp, noise->pac + noise->next * BT_PAC_PER_FRAME, pac);
    for (int slot = 0; slot < BT_SLOTS; slot++) {
        int channel = bt_slot_channel[slot], e = channel - BT_CHANNEL_E1, k = channel - BT_CHANNEL_PDC;
        if (channel == BT_CHANNEL_PAC) {
            words[slot] = word(pac[bt_slot_pac[slot]]);
        } else if (e < 0) {
            words[slot] = word(slot_value(now, slot, channel) + slow_noise[k] * slow[k]);
        } else {
            double counts = slot_value(now, slot, channel) + now->finger->noise_counts * electrodes[e];
            words[slot] =
                word(counts - glitch(&reader->glitched[e], now->finger->glitch_share, glitches + 2 * e));
        }
    }
}

void bt_begin(bt_reader *reader, const bt_sampling *sampling, const bt_effects *effects)
{
    reader->before = *effects;
    follow_all(reader, sampling, effects);
}

int64_t bt_read(bt_reader *reader, const bt_sampling *sampling, const bt_skin_finger *finger, int64_t n,
                int32_t pieces, const bt_effects *effects, int64_t stride, bt_drawn *noise, uint16_t *words)
{
    int64_t read = 0;
    if (reader->undershoot.keep == 0) {
        bt_begin(reader, sampling, effects);
    }
    for (; read < n && noise->next < noise->rounds; read++, noise->next++) {
        round_now now = {.sampling = sampling,
                         .finger = finger,
                         .effects = effects + read * stride,
                         .pieces = pieces,
                         .number = reader->round++,
                         .begin_undershoot = reader->undershoot,
                         .begin_pressure_creep = reader->pressure_creep,
                         .end = reader};
        memcpy(now.begin_creep, reader->creep, sizeof now.begin_creep);
        follow_all(reader, sampling, &now.effects[pieces - 1]);
        read_round(reader, &now, noise, words + read * BT_SLOTS);
        reader->before = now.effects[pieces - 1];
    }
    return read;
}
