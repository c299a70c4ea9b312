#include "skin/effects.h"

#include <math.h>
#include <stddef.h>

// One electrode's counts: the divider's, at the electrode's resistance.
static double counts_at(const bt_skin *skin, double r0_ohm, double gain, double compression, double bulge,
                        double warmed)
{
    double squeezed = skin->squeeze_max * tanh(compression * gain / skin->squeeze_max);
    double share = skin->fixed_share + (1 - skin->fixed_share) * exp(2 * (squeezed - bulge * gain));
    return BT_FULL_SCALE_COUNT * skin->load_ohm / (r0_ohm * share * warmed + skin->load_ohm);
}

static void counts_of(const bt_skin *skin, const double *r0_ohm, const double *gap_gain,
                      const double *compression, const double *bulge, double warm_c, double *counts)
{
    double warmed = exp(skin->temperature_per_c * warm_c);
    for (int e = 0; e < BT_ELECTRODES; e++) {
        counts[e] = counts_at(skin, r0_ohm[e], gap_gain[e], compression[e], bulge[e], warmed);
    }
}

void bt_skin_counts(const bt_skin *skin, const double *r0_ohm, const double *gap_gain, int64_t n,
                    const double *compression, const double *bulge, const double *warm_c, double *counts)
{
    static const double none[BT_ELECTRODES];
    for (int64_t k = 0; k < n; k++) {
        const double *squeezed = compression == NULL ? none : compression + k * BT_ELECTRODES;
        const double *widened = bulge == NULL ? none : bulge + k * BT_ELECTRODES;
        counts_of(skin, r0_ohm, gap_gain, squeezed, widened, warm_c == NULL ? 0 : warm_c[k],
                  counts + k * BT_ELECTRODES);
    }
}

void bt_loudness(const bt_skin *skin, double tip_gain, double side_gain, int64_t n, const double *contact_mm,
                 double *share)
{
    for (int64_t k = 0; k < n; k++) {
        double normal[3];
        bt_normal_at(contact_mm + 3 * k, normal);
        double tip = (normal[0] - skin->tip_from) / (1 - skin->tip_from);
        double side = (fabs(normal[1]) - skin->side_from) / (skin->side_to - skin->side_from);
        share[k] = pow(tip_gain, fmin(fmax(tip, 0), 1)) * pow(side_gain, fmin(fmax(side, 0), 1));
    }
}

void bt_tdc_counts(const bt_skin *skin, int64_t n, const double *celsius, double *counts)
{
    for (int64_t k = 0; k < n; k++) {
        double kelvin = celsius[k] + 273.15;
        counts[k] = BT_FULL_SCALE_COUNT * (skin->tdc_a / (exp(skin->tdc_beta_k / kelvin) + skin->tdc_b));
    }
}

void bt_effects_of(const bt_skin *skin, const bt_skin_finger *finger, int64_t n, int32_t contacts,
                   const bt_touched *touched, bt_effects *effects)
{
    static const double none[BT_ELECTRODES];
    for (int64_t k = 0; k < n; k++, effects++) {
        double compression[BT_ELECTRODES] = {0}, bulge[BT_ELECTRODES] = {0}, rest[BT_ELECTRODES];
        double warm_c = touched[0].contact->warm_c[k], celsius = skin->rest_celsius + warm_c;
        effects->force_n = effects->pressure = effects->slip_mm_s = 0;
        for (int32_t c = 0; c < contacts; c++) {
            const bt_contact *contact = touched[c].contact;
            const double *at_mm = contact->contact_mm + 3 * k;
            double loud, per_n = finger->pdc_per_n * (1 + 0.15 * tanh(at_mm[0] / 8));
            bt_loudness(skin, finger->tip_gain, finger->side_gain, 1, at_mm, &loud);
            for (int e = 0; touched[c].compression != NULL && e < BT_ELECTRODES; e++) {
                compression[e] += loud * touched[c].compression[k * BT_ELECTRODES + e];
                bulge[e] += loud * touched[c].bulge[k * BT_ELECTRODES + e];
            }
            effects->force_n += contact->force_n[k];
            effects->pressure += per_n * loud * contact->force_n[k]; // as if skin were a spring
            if (contact->slip_mm_s != NULL) {
                effects->slip_mm_s = fmax(effects->slip_mm_s, contact->slip_mm_s[k]);
            }
        }
        bt_tdc_counts(skin, 1, &celsius, &effects->tdc);
        if (touched[0].compression == NULL) {
            continue;
        }
        counts_of(skin, finger->r0_ohm, finger->gap_gain, compression, bulge, warm_c, effects->exact);
        counts_of(skin, finger->r0_ohm, finger->gap_gain, none, none, warm_c, rest);
        for (int e = 0; e < BT_ELECTRODES; e++) {
            effects->pressed[e] = effects->exact[e] - rest[e];
        }
    }
}
