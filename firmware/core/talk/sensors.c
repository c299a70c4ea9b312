#include "talk/sensors.h"

#include <string.h>

// Unit: rounds between two requests to a silent sensor. Each request costs a round of any samples.
#define ASK_PERIOD      10
#define ASK_PERIOD_LATE 100
#define LATE_AFTER      10 // requests

void bt_sensors_doubt(bt_session *session, unsigned f)
{
    if (!(session->unsure >> f & 1)) {
        session->unsure |= (uint8_t)(1u << f);
        session->query[f] = (bt_sensor_query){.rounds_left = 0};
    }
}

void bt_sensors_slot(bt_session *session, const uint16_t count[BT_MAX_FINGERS])
{
    for (unsigned f = 0; f < BT_MAX_FINGERS; f++) {
        bt_sensor_query *query = &session->query[f];
        if (session->asked >> f & 1) {
            continue;
        }
        if (count[f] != BT_INVALID_COUNT) {
            query->bad_words = 0;
        } else if (query->bad_words < BT_AWAY_WORDS && ++query->bad_words == BT_AWAY_WORDS) {
            bt_sensors_doubt(session, f);
            query->bad_words = BT_AWAY_WORDS;
        }
    }
}

static bool wants(bt_session *session, unsigned f)
{
    bt_sensor_query *query = &session->query[f];
    bool answers = session->finger[f].present;
    bool back = answers && !query->answered;
    query->answered = answers;
    if (back || query->rounds_left == 0) {
        if (query->attempts < LATE_AFTER) {
            query->attempts++;
        }
        query->rounds_left = query->attempts < LATE_AFTER ? ASK_PERIOD : ASK_PERIOD_LATE;
        return true;
    }
    query->rounds_left--;
    return false;
}

// One at a time: each costs the sampling interrupt some 10 us a slot.
uint8_t bt_sensors_to_ask(bt_session *session)
{
    uint8_t mask = 0;
    for (unsigned f = 0; f < BT_MAX_FINGERS; f++) {
        bool asked = session->asked >> f & 1; // this round shows no answer
        if (mask == 0 && !asked && session->unsure >> f & 1 && wants(session, f)) {
            mask = (uint8_t)(1u << f);
        }
    }
    return mask;
}

void bt_sensors_answer(bt_session *session, unsigned f, const uint8_t serial[BT_SERIAL_BYTES])
{
    bt_sensor_info *info = &session->info[f];
    session->finger[f].foreign = bt_serial_is_foreign(serial);
    if (session->finger[f].foreign) {
        return; // stays in doubt: nothing stored can fit this sensor
    }
    session->unsure &= (uint8_t)~(1u << f);
    session->query[f].bad_words = 0;
    if (info->present && memcmp(info->serial, serial, BT_SERIAL_BYTES) == 0) {
        return;
    }
    bool other = info->present;
    memset(info, 0, sizeof *info);
    info->finger = (uint8_t)f;
    info->present = 1;
    memcpy(info->serial, serial, BT_SERIAL_BYTES);
    if (other) {
        bt_finger_forget(&session->finger[f]);
    }
    bt_session_sensor_changed(session, f, other);
}

uint32_t bt_sensors_flags(const bt_session *session, unsigned f)
{
    uint32_t unsure = session->unsure >> f & 1, other = session->other >> f & 1;
    return (unsure ? BT_FRAME_FLAG_SENSOR_UNSURE : 0) | (other ? BT_FRAME_FLAG_SENSOR_OTHER : 0);
}
