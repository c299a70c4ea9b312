// Time and the sampler's alarm.
#include "only_board.h"

#include "system.h"
#include "wait.h"

static void timer_interrupt(void)
{
    REG_CLR(TIMER_INTF) = TIMER_ALARM0_BIT;
    TIMER_INTR = TIMER_ALARM0_BIT; // writing 1 clears
    if (bt_port_alarm()) {
        wake();
    }
}

void timer_start(void)
{
    TIMER_DBGPAUSE =
        0; // a debugger halts core 1, which is never started, and time would stop (pico-sdk #1152)
    REG_SET(TIMER_INTE) = TIMER_ALARM0_BIT;
    use_interrupt(TIMER_IRQ_0, 0, timer_interrupt);
}

uint32_t port_now_us(bt_port *port)
{
    return TIMER_TIMERAWL;
}

#define SHORT_US 10 // the gap between two reads of the bus, four times a slot

void port_delay_us(bt_port *port, uint32_t us)
{
    if (us <= SHORT_US) {
        wait_short_us(us);
    } else {
        wait_us(us);
    }
}

void port_alarm_at(bt_port *port, uint32_t at_us)
{
    TIMER_ALARM0 = at_us;
    // It fires when the clock equals it: a past one would wait for 71 minutes.
    if ((int32_t)(at_us - TIMER_TIMERAWL) <= 0) {
        TIMER_ARMED = TIMER_ALARM0_BIT; // writing 1 disarms
        REG_SET(TIMER_INTF) = TIMER_ALARM0_BIT;
    }
}
