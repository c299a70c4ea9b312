// Clocks, watchdog, reset, and the traces of a reset.
#include "stm32f405.h"

#include "pins.h"
#include "wire/messages_gen.h"

// The PLL: crystal / PLL_M * 288 / 2 = 144 MHz. From there APB1 has 36 MHz; an eighth of that is SPI's 4.5, 2
// % above BT_SPI_HZ. No division of the chip's 168 MHz is so near.
#define PLL_M (CRYSTAL_HZ / 1000000u)
#define PLL_N 288u

// Neither start-up nor a reset clears these.
static uint32_t running __attribute__((section(".noinit")));
static uint32_t asked_for __attribute__((section(".noinit")));
#define RUNNING    0x42544757u // "WGTB"
#define THE_LOADER 0x4C4F4144u

// Before anything else is touched: the ROM expects the chip as after a reset.
AT_BOOT static void jump_to_loader(void)
{
    asked_for = 0;
    clock_on(&RCC_APB2ENR, RCC_APB2ENR_SYSCFG);
    SYSCFG_MEMRMP = SYSCFG_MEMRMP_SYSTEM;
    __asm volatile("msr msp, %0\n bx %1" ::"r"(SYSTEM_MEMORY[0]), "r"(SYSTEM_MEMORY[1]) : "memory");
}

AT_BOOT bool clocks_start(void)
{
    if (asked_for == THE_LOADER) {
        jump_to_loader();
    }
    // After Go, the ROM's loader leaves the PLL on, so that PLLCFGR cannot be written, and interrupts enabled
    // that have no handler here (AN2606; stm32duino #1653).
    for (uint32_t number = 0; number < CHIP_INTERRUPTS; number += 32) {
        NVIC_ICER(number) = UINT32_MAX;
    }
    RCC_CR |= RCC_CR_HSION;
    if (!wait_for(&RCC_CR, RCC_CR_HSIRDY, RCC_CR_HSIRDY, WAIT_CLOCKS_TURNS)) {
        return CLOCKS_ARE_NOT_MODELLED;
    }
    RCC_CFGR = 0;
    const bool on_hsi = wait_for(&RCC_CFGR, RCC_CFGR_SWS, 0, WAIT_CLOCKS_TURNS);
    RCC_CR &= ~RCC_CR_PLLON;
    if (!on_hsi || !wait_for(&RCC_CR, RCC_CR_PLLRDY, 0, WAIT_CLOCKS_TURNS)) {
        return false;
    }
    clock_on(&RCC_APB1ENR, RCC_APB1ENR_PWR);
    PWR_CR |= PWR_CR_VOS;
    RCC_CR |= RCC_CR_HSEON;
    if (!wait_for(&RCC_CR, RCC_CR_HSERDY, RCC_CR_HSERDY, WAIT_CLOCKS_TURNS)) {
        return false;
    }
    FLASH_ACR = FLASH_ACR_4_WAITS | FLASH_ACR_PREFETCH | FLASH_ACR_ICEN | FLASH_ACR_DCEN;
    RCC_PLLCFGR =
        PLL_M | PLL_N << 6 | RCC_PLLCFGR_FROM_HSE | 6u << 24; // divided by two; by six for the USB's 48
    RCC_CFGR = RCC_CFGR_APB1_BY_4 | RCC_CFGR_APB2_BY_2;
    RCC_CR |= RCC_CR_PLLON;
    if (!wait_for(&RCC_CR, RCC_CR_PLLRDY, RCC_CR_PLLRDY, WAIT_CLOCKS_TURNS)) {
        return false;
    }
    if ((FLASH_ACR & FLASH_ACR_LATENCY) != FLASH_ACR_4_WAITS) { // valid before the clock is (RM0090 3.5.1)
        return false;
    }
    RCC_CFGR |= RCC_CFGR_SW_PLL;
    return wait_for(&RCC_CFGR, RCC_CFGR_SWS, RCC_CFGR_SWS_PLL, WAIT_CLOCKS_TURNS);
}

void clock_start(void)
{
    clock_on(&RCC_AHB1ENR, RCC_AHB1ENR_GPIO);
    clock_on(&RCC_AHB2ENR, RCC_AHB2ENR_RNG);
    clock_on(&RCC_APB1ENR, RCC_APB1ENR_TIM2 | RCC_APB1ENR_SPI2 | RCC_APB1ENR_USART3);
    TIM2_PSC = TIM2_HZ / 1000000u - 1;
    TIM2_ARR = UINT32_MAX;
    TIM2_EGR = TIM2_EGR_UG;
    TIM2_CR1 = TIM2_CR1_CEN;
}

uint32_t clock_us(void)
{
    return TIM2_CNT;
}

void watchdog_start(void)
{
    // A debugger's halt stops time and watchdog with the core; the debugger sets DBG_SLEEP (ES0182 2.1.3).
    DBGMCU_APB1_FZ |= DBGMCU_IWDG_STOP | DBGMCU_TIM2_STOP;
    IWDG_KR = IWDG_KR_ACCESS;
    IWDG_PR = IWDG_PR_BY_64;
    IWDG_RLR = 1000; // 2 s, 1.4 at least: longer than a sector's erase
    IWDG_KR = IWDG_KR_START;
}

void watchdog_feed(void)
{
    IWDG_KR = IWDG_KR_FEED;
}

AT_BOOT void early_reset(void)
{
    system_reset();
}

void system_reset(void)
{
    SCB_AIRCR = SCB_AIRCR_RESET;
    for (;;) { // some cycles at most: the reset is on its way
    }
}

void restart(bool to_loader)
{
    running = 0;
    asked_for = to_loader ? THE_LOADER : 0;
    system_reset();
}

uint16_t started_by(void)
{
    const uint32_t reason = RCC_CSR;
    uint16_t flag = BT_FAULT_FLAG_STARTED;
    if (running == RUNNING && reason & RCC_CSR_IWDGRSTF) {
        flag = BT_FAULT_FLAG_HUNG;
    } else if (running == RUNNING && reason & RCC_CSR_SFTRSTF) {
        flag = BT_FAULT_FLAG_CRASHED; // resets on purpose clear `running` first
    }
    RCC_CSR |= RCC_CSR_RMVF;
    running = RUNNING;
    return flag;
}
