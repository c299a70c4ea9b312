#include "solve/flags.h"

#define BASE_OLD_FRAMES (60000 / BT_FRAME_MS) // one minute

static BT_NOINLINE uint32_t trouble(const bt_round *round, const bt_tare *tare)
{
    uint32_t flags = 0;
    flags |= tare->trigger.without != 0 ? BT_FRAME_FLAG_ELECTRODE_OUT : 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint16_t count = round->electrode[i];
        flags |= count == BT_INVALID_COUNT ? BT_FRAME_FLAG_ELECTRODE_MISSING : 0;
        flags |= bt_count_railed(count) ? BT_FRAME_FLAG_RAIL : 0;
    }
    flags |= bt_tare_faulty(tare) ? BT_FRAME_FLAG_FAULT : 0;
    flags |= !bt_count_usable(round->pdc) ? BT_FRAME_FLAG_PDC_MISSING : 0;
    flags |= round->tac == BT_INVALID_COUNT ? BT_FRAME_FLAG_TAC_MISSING : 0;
    flags |= round->tdc == BT_INVALID_COUNT ? BT_FRAME_FLAG_TDC_MISSING : 0;
    return flags;
}

_Static_assert((BT_FULL_SCALE_COUNT & (BT_FULL_SCALE_COUNT + 1)) == 0
                   && BT_INVALID_COUNT > BT_FULL_SCALE_COUNT,
               "the OR of counts must exceed full scale only where a word is missing");

uint32_t bt_channel_flags(const bt_round *round, const bt_tare *tare)
{
    uint32_t flags = 0;
    // One comparison for what hardly ever happens: a missing word is above every count.
    uint32_t counts = (uint32_t)(round->tac | round->tdc);
    if (counts > BT_FULL_SCALE_COUNT || !bt_count_usable(round->pdc) || tare->trigger.odd != 0) {
        flags |= trouble(round, tare);
    }
    if (!tare->tared) {
        flags |= BT_FRAME_FLAG_UNTARED | BT_FRAME_FLAG_POC_INVALID;
    }
    flags |= tare->held ? BT_FRAME_FLAG_HELD : 0;
    if (bt_tare_touched(tare)) {
        flags |= tare->state == BT_TARE_STATE_DOUBT ? BT_FRAME_FLAG_DOUBT : BT_FRAME_FLAG_CONTACT;
        flags |= tare->contact_rounds > BASE_OLD_FRAMES ? BT_FRAME_FLAG_BASE_OLD : 0;
    }
    flags |= tare->drifted_sweeps != 0 ? BT_FRAME_FLAG_BASE_OLD : 0;
    if (tare->tared && (tare->unsure || tare->likely)) {
        flags |= tare->unsure ? BT_FRAME_FLAG_TARE_UNSURE : BT_FRAME_FLAG_TARE_LIKELY;
    }
    flags |= tare->witness.flat ? BT_FRAME_FLAG_PDC_FLAT : 0;
    return flags;
}

// An interval that lets a force be acted on: 0.4 N to either side of its normal part, or a quarter of that.
#define NARROW_MN    400
#define NARROW_SHARE 4

uint8_t bt_trust(uint32_t flags, uint16_t normal_mn, uint16_t half_mn)
{
    if (flags & (BT_TRUST_FLAGS_NONE | BT_TRUST_FLAGS_HOLD)) {
        return flags & BT_TRUST_FLAGS_NONE ? BT_TRUST_NONE : BT_TRUST_HOLD;
    }
    bool wide = half_mn > NARROW_MN && half_mn > normal_mn / NARROW_SHARE; // as one that is unknown
    return wide || flags & BT_TRUST_FLAGS_INTERVAL ? BT_TRUST_INTERVAL : BT_TRUST_ACT;
}
