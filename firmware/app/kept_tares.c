#include "kept_tares.h"

#include "wire/crc32.h"

#include <stddef.h>
#include <string.h>

#define PERIOD_ROUNDS 50

static bool is_whole(const bt_kept_copy *copy)
{
    return copy->crc32 == bt_crc32((const uint8_t *)copy, offsetof(bt_kept_copy, crc32));
}

// The newer whole copy; -1: none, as after power-on.
static int latest(const bt_kept_tares *kept)
{
    const bool whole[2] = {is_whole(&kept->copy[0]), is_whole(&kept->copy[1])};
    if (whole[0] && whole[1]) {
        return (int32_t)(kept->copy[1].count - kept->copy[0].count) > 0;
    }
    return whole[0] ? 0 : whole[1] ? 1 : -1;
}

// A new tare, HOLD and RELEASE reset a tare's age; the host's do so before the round that ends now.
static bool is_due(const bt_session *session, uint32_t *rounds)
{
    bool due = ++*rounds >= PERIOD_ROUNDS;
    for (unsigned f = 0; f < BT_MAX_FINGERS; f++) {
        const bt_tare *tare = &session->finger[f].tare;
        due = due || (tare->tared && tare->age_rounds <= 1);
    }
    *rounds = due ? 0 : *rounds;
    return due;
}

void bt_kept_tares_note(bt_kept_tares *kept, const bt_session *session, uint32_t *rounds)
{
    if (!is_due(session, rounds)) {
        return;
    }
    const int before = latest(kept);
    bt_kept_copy *older = &kept->copy[before == 0];
    older->crc32 = ~older->crc32; // void while it is written
    older->count = before < 0 ? 0 : kept->copy[before].count + 1;
    for (unsigned f = 0; f < BT_MAX_FINGERS; f++) {
        const bt_tare *tare = &session->finger[f].tare;
        bt_kept_tare *to = &older->finger[f];
        memset(to->serial, 0, sizeof to->serial);
        if (tare->tared && session->info[f].present && !(session->unsure >> f & 1)) {
            memcpy(to->serial, session->info[f].serial, sizeof to->serial);
        }
        bt_tare_keep(tare, &to->tare);
    }
    older->crc32 = bt_crc32((const uint8_t *)older, offsetof(bt_kept_copy, crc32));
}

bool bt_kept_tares_restore(const bt_kept_tares *kept, bt_session *session)
{
    const int at = latest(kept);
    bool any = false;
    for (unsigned f = 0; at >= 0 && f < BT_MAX_FINGERS; f++) {
        const bt_kept_tare *from = &kept->copy[at].finger[f];
        const bt_sensor_info *info = &session->info[f];
        if (info->present && from->serial[0] != 0
            && memcmp(from->serial, info->serial, sizeof from->serial) == 0) {
            bt_tare_restore(&session->finger[f].tare, &from->tare);
            any = true;
        }
    }
    return any;
}
