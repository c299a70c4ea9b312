// Registers of the STM32F405, by the names of the reference manual (RM0090); only those in use here.
#ifndef BIOTAC_STM32F405_REGS_H
#define BIOTAC_STM32F405_REGS_H

#include "cortex_m.h"

#include <stdint.h>

// Set by clocks_start (clocks.c) from the board's crystal, with APB1's and its timers' rates. A board may
// define others (QEMU's own).
#ifndef HCLK_HZ
#define HCLK_HZ 144000000u
#endif
#define APB1_HZ (HCLK_HZ / 4) // SPI2, USART3
#ifndef TIM2_HZ
#define TIM2_HZ (HCLK_HZ / 2)
#endif

#define CHIP_INTERRUPTS 82 // 12.2

#define SCB_AIRCR       REG32(0xE000ED0Cu)
#define SCB_AIRCR_RESET (0x05FA0000u | 1u << 2)

// ---- 3.9 flash interface
#define FLASH_ACR          REG32(0x40023C00u)
#define FLASH_ACR_LATENCY  (7u << 0)
#define FLASH_ACR_4_WAITS  (4u << 0) // 120 to 150 MHz, 2.7 to 3.6 V
#define FLASH_ACR_PREFETCH (1u << 8)
#define FLASH_ACR_ICEN     (1u << 9)
#define FLASH_ACR_DCEN     (1u << 10)
#define FLASH_ACR_DCRST    (1u << 12)
#define FLASH_KEYR         REG32(0x40023C04u)
#define FLASH_KEY_1        0x45670123u
#define FLASH_KEY_2        0xCDEF89ABu
#define FLASH_SR           REG32(0x40023C0Cu)
#define FLASH_SR_ERRORS    0xF2u
#define FLASH_SR_BSY       (1u << 16)
#define FLASH_CR           REG32(0x40023C10u)
#define FLASH_CR_PG        (1u << 0)
#define FLASH_CR_SER       (1u << 1)
#define FLASH_CR_SNB(n)    ((uint32_t)(n) << 3)
#define FLASH_CR_BY_32     (2u << 8)
#define FLASH_CR_STRT      (1u << 16)
#define FLASH_CR_LOCK      (1u << 31)

// ---- 5.4 power
#define PWR_CR     REG32(0x40007000u)
#define PWR_CR_VOS (1u << 14) // scale 1, up to 168 MHz; an F42x has two bits

// ---- 7.3 RCC
#define RCC_CR               REG32(0x40023800u)
#define RCC_CR_HSION         (1u << 0)
#define RCC_CR_HSIRDY        (1u << 1)
#define RCC_CR_HSEON         (1u << 16)
#define RCC_CR_HSERDY        (1u << 17)
#define RCC_CR_PLLON         (1u << 24)
#define RCC_CR_PLLRDY        (1u << 25)
#define RCC_PLLCFGR          REG32(0x40023804u)
#define RCC_PLLCFGR_FROM_HSE (1u << 22)
#define RCC_CFGR             REG32(0x40023808u)
#define RCC_CFGR_SW_PLL      (2u << 0)
#define RCC_CFGR_SWS         (3u << 2)
#define RCC_CFGR_SWS_PLL     (2u << 2)
#define RCC_CFGR_APB1_BY_4   (5u << 10)
#define RCC_CFGR_APB2_BY_2   (4u << 13)
#define RCC_AHB1ENR          REG32(0x40023830u)
#define RCC_AHB1ENR_GPIO     0x1FFu
#define RCC_AHB2ENR          REG32(0x40023834u)
#define RCC_AHB2ENR_RNG      (1u << 6)
#define RCC_APB1ENR          REG32(0x40023840u)
#define RCC_APB1ENR_TIM2     (1u << 0)
#define RCC_APB1ENR_SPI2     (1u << 14)
#define RCC_APB1ENR_USART3   (1u << 18)
#define RCC_APB1ENR_PWR      (1u << 28)
#define RCC_CSR              REG32(0x40023874u)
#define RCC_CSR_RMVF         (1u << 24)
#define RCC_CSR_SFTRSTF      (1u << 28)
#define RCC_CSR_IWDGRSTF     (1u << 29)

// ---- 8.4 GPIO; port: 0 for A, 1 for B, ...
#define GPIO_MODER(port)   REG32(0x40020000u + 0x400u * (port))
#define GPIO_OSPEEDR(port) REG32(0x40020008u + 0x400u * (port))
#define GPIO_PUPDR(port)   REG32(0x4002000Cu + 0x400u * (port))
#define GPIO_BSRR(port)    REG32(0x40020018u + 0x400u * (port))
#define GPIO_AFR(port, k)  REG32(0x40020020u + 0x400u * (port) + 4u * (k))

// ---- 18.4 TIM2, 32 bits
#define TIM2_CR1     REG32(0x40000000u)
#define TIM2_CR1_CEN (1u << 0)
#define TIM2_EGR     REG32(0x40000014u)
#define TIM2_EGR_UG  (1u << 0)
#define TIM2_CNT     REG32(0x40000024u)
#define TIM2_PSC     REG32(0x40000028u)
#define TIM2_ARR     REG32(0x4000002Cu)

// ---- 21.4 independent watchdog
#define IWDG_KR        REG32(0x40003000u)
#define IWDG_KR_ACCESS 0x5555u
#define IWDG_KR_FEED   0xAAAAu
#define IWDG_KR_START  0xCCCCu
#define IWDG_PR        REG32(0x40003004u)
#define IWDG_PR_BY_64  4u // 2 ms a tick at 32 kHz, which may be 17 to 47
#define IWDG_RLR       REG32(0x40003008u)

// ---- 24.4 RNG
#define RNG_CR       REG32(0x50060800u)
#define RNG_CR_RNGEN (1u << 2)
#define RNG_SR       REG32(0x50060804u)
#define RNG_SR_DRDY  (1u << 0)
#define RNG_DR       REG32(0x50060808u)

// ---- 28.5 SPI2
#define SPI2_CR1        REG32(0x40003800u)
#define SPI_CR1_MSTR    (1u << 2)
#define SPI_CR1_BR(n)   ((uint32_t)(n) << 3) // the bus's clock / 2^(n + 1)
#define SPI_CR1_SPE     (1u << 6)
#define SPI_CR1_SSI     (1u << 8)
#define SPI_CR1_SSM     (1u << 9)
#define SPI_CR1_16_BITS (1u << 11)
#define SPI2_SR         REG32(0x40003808u)
#define SPI_SR_RXNE     (1u << 0)
#define SPI_SR_BSY      (1u << 7)
#define SPI2_DR         REG32(0x4000380Cu)

// ---- 30.6 USART3
#define USART3_IRQ       39
#define USART3_SR        REG32(0x40004800u)
#define USART_SR_ORE     (1u << 3)
#define USART_SR_RXNE    (1u << 5)
#define USART_SR_TC      (1u << 6)
#define USART_SR_TXE     (1u << 7)
#define USART3_DR        REG32(0x40004804u)
#define USART3_BRR       REG32(0x40004808u)
#define USART3_CR1       REG32(0x4000480Cu)
#define USART_CR1_RE     (1u << 2)
#define USART_CR1_TE     (1u << 3)
#define USART_CR1_RXNEIE (1u << 5)
#define USART_CR1_TXEIE  (1u << 7)
#define USART_CR1_UE     (1u << 13)
#define USART_CR1_OVER8  (1u << 15) // BRR in eights

// ---- 39.1, 38.6.1 the chip's 96-bit number and kind
#define UNIQUE_ID        ((const volatile uint32_t *)0x1FFF7A10u)
#define DBGMCU_IDCODE    REG32(0xE0042000u)
#define DBGMCU_APB1_FZ   REG32(0xE0042008u)
#define DBGMCU_TIM2_STOP (1u << 0)
#define DBGMCU_IWDG_STOP (1u << 12)

// ---- 2.4 the ROM's loader (AN2606, AN3155)
#define SYSTEM_MEMORY        ((const volatile uint32_t *)0x1FFF0000u)
#define RCC_APB2ENR          REG32(0x40023844u)
#define RCC_APB2ENR_SYSCFG   (1u << 14)
#define SYSCFG_MEMRMP        REG32(0x40013800u)
#define SYSCFG_MEMRMP_SYSTEM 1u

#endif
