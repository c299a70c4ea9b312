#include "talk/scheduler.h"

#include "finger.h"

// How long after its round's last slot a finger's FRAME may begin before something is left out. At full load
// the last of five begins 8 ms late; slots are buffered for 29 ms (BT_SLOT_RING).
#define MAP_LATE_US   11000
#define FRAME_LATE_US 22000

void bt_scheduler_begin(bt_scheduler *scheduler)
{
    scheduler->first_next = BT_MAX_FINGERS;
}

uint8_t bt_scheduler_finger(const bt_scheduler *scheduler, int k)
{
    const int finger = scheduler->first + k;
    return (uint8_t)(finger < BT_MAX_FINGERS ? finger : finger - BT_MAX_FINGERS);
}

// The first finger for which a wrench or a FRAME is left out comes first in the next round.
static void put_first(bt_scheduler *scheduler, uint8_t finger)
{
    if (scheduler->first_next == BT_MAX_FINGERS) {
        scheduler->first_next = finger;
    }
}

uint32_t bt_scheduler_shed(bt_scheduler *scheduler, uint8_t finger, int32_t late_us, bool can_repeat)
{
    if (late_us > FRAME_LATE_US) {
        put_first(scheduler, finger);
        return BT_SHED_FRAME;
    }
    if (late_us > MAP_LATE_US && can_repeat) {
        put_first(scheduler, finger);
        return BT_SHED_MAP;
    }
    return 0;
}

void bt_scheduler_end(bt_scheduler *scheduler)
{
    scheduler->first = (uint8_t)(scheduler->first_next % BT_MAX_FINGERS);
}
