#include "talk/scheduler.h"

#include "finger.h"

// Latest start of a finger's FRAME after the round's last slot; later, part of it is shed. At full load the
// last of five begins 8 ms late; slots are buffered for 29 ms (BT_SLOT_RING).
#define MAP_LATE_US   11000
#define FRAME_LATE_US 22000

uint8_t bt_scheduler_finger(const bt_scheduler *scheduler, int k)
{
    const int finger = scheduler->first + k;
    return (uint8_t)(finger < BT_MAX_FINGERS ? finger : finger - BT_MAX_FINGERS);
}

uint32_t bt_scheduler_shed(bt_scheduler *scheduler, uint8_t finger, int32_t late_us, bool can_repeat)
{
    const uint32_t shed = late_us > FRAME_LATE_US               ? BT_SHED_FRAME
                          : late_us > MAP_LATE_US && can_repeat ? BT_SHED_MAP
                                                                : 0;
    if (shed != 0 && scheduler->first_short == 0) {
        scheduler->first_short = (uint8_t)(finger + 1);
    }
    return shed;
}

void bt_scheduler_end(bt_scheduler *scheduler)
{
    scheduler->first = (uint8_t)(scheduler->first_short != 0 ? scheduler->first_short - 1 : 0);
    scheduler->first_short = 0;
}
