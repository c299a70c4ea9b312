// SysTick counts 24 bits down, once; a later alarm needs several runs.
#include "cortex_m.h"

#include "only_board.h"

#define SYST_CSR           REG32(0xE000E010u)
#define SYST_RVR           REG32(0xE000E014u)
#define SYST_CVR           REG32(0xE000E018u)
#define SYST_ONCE          7u // on, with its interrupt, at the core's clock
#define SCB_ICSR           REG32(0xE000ED04u)
#define SCB_ICSR_PENDSTSET (1u << 26)

#define LONGEST_US 50000 // at up to 335 MHz
#define SHORT_US   10    // the gap between two reads of the bus, four times a slot

static uint32_t cycles_per_us;
static volatile uint32_t alarm_us;

uint32_t port_now_us(bt_port *port)
{
    return clock_us();
}

void port_delay_us(bt_port *port, uint32_t us)
{
    if (us <= SHORT_US) {
        wait_cycles(us * cycles_per_us);
        return;
    }
    // The clock runs, or this program would not have come this far; the bound is for a clock that stops.
    const uint32_t start_us = clock_us();
    for (uint32_t turns = us * cycles_per_us; turns != 0 && clock_us() - start_us <= us; turns--) {
    }
}

static void arm(void)
{
    int32_t ahead_us = (int32_t)(alarm_us - clock_us());
    SYST_CSR = 0;
    if (ahead_us <= 0) {
        SCB_ICSR = SCB_ICSR_PENDSTSET; // past already: at once
        return;
    }
    SYST_RVR = (uint32_t)(ahead_us < LONGEST_US ? ahead_us : LONGEST_US) * cycles_per_us;
    SYST_CVR = 0;
    SYST_CSR = SYST_ONCE;
}

void port_alarm_at(bt_port *port, uint32_t at_us)
{
    uint32_t primask = interrupts_disable();
    alarm_us = at_us;
    arm();
    interrupts_restore(primask);
}

static void alarm_interrupt(void)
{
    SYST_CSR = 0;
    if ((int32_t)(alarm_us - clock_us()) > 0) {
        arm();
    } else if (bt_port_alarm()) {
        wake();
    }
}

void systick_alarm_start(uint32_t core_hz)
{
    cycles_per_us = core_hz / 1000000u;
    use_interrupt(SYSTICK, 1, alarm_interrupt);
}
