/* A bare chip in QEMU: start, files of the host by semihosting, and a counter of instructions under -icount shift=0. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

int chip_main(void);

#if defined(__riscv)

static inline uint32_t chip_call(uint32_t operation, const void *arguments)
{
    register uint32_t a0 __asm__("a0") = operation;
    register const void *a1 __asm__("a1") = arguments;
    __asm__ volatile(".option push\n.option norvc\n.balign 16\nslli x0, x0, 0x1f\nebreak\nsrai x0, x0, 7\n.option pop"
                     : "+r"(a0)
                     : "r"(a1)
                     : "memory");
    return a0;
}

/* Instructions since some time. */
static inline uint32_t chip_instructions(void)
{
    uint32_t count;
    __asm__ volatile("csrr %0, minstret" : "=r"(count));
    return count;
}

static inline void chip_counter(void)
{
}

void chip_reset(void);
__asm__(".section .start, \"ax\"\n.globl _start\n_start:\nla sp, chip_stack_top\nla gp, __global_pointer$\nj chip_reset\n.text");

#else

static inline uint32_t chip_call(uint32_t operation, const void *arguments)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = arguments;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* SysTick counts periods of the core's clock down, a nanosecond being an instruction. */
static inline uint32_t chip_instructions(void)
{
    const uint32_t period = 0x00FFFFFFU - *(volatile uint32_t *)0xE000E018U;
    return (uint32_t)(((uint64_t)period * 1000U) / CHIP_MHZ);
}

static inline void chip_counter(void)
{
    *(volatile uint32_t *)0xE000E010U = 0U;
    *(volatile uint32_t *)0xE000E014U = 0x00FFFFFFU;
    *(volatile uint32_t *)0xE000E018U = 0U;
    *(volatile uint32_t *)0xE000E010U = 5U;
}

void chip_reset(void);
extern uint32_t chip_stack_top[];
typedef struct {
    uint32_t *stack;
    void (*reset)(void);
} chip_start;
__attribute__((section(".start"), used)) static const chip_start chip_vectors = {chip_stack_top, chip_reset};

#endif

extern uint32_t chip_data_start[];
extern uint32_t chip_data_end[];
extern const uint32_t chip_data_image[];
extern uint32_t chip_bss_start[];
extern uint32_t chip_bss_end[];

static inline void chip_exit(bool well)
{
    /* ADP_Stopped_ApplicationExit; a RISC-V or another way ends as well, without its word. */
    (void)chip_call(0x18U, (const void *)(uintptr_t)(well ? 0x20026U : 0x20023U));
    for (;;) {
    }
}

/* Opens a file of the host; `mode` as SYS_OPEN has it: 1 reads, 5 writes. */
static inline uint32_t chip_open(const char *name, uint32_t length, uint32_t mode)
{
    const uint32_t arguments[3] = {(uint32_t)(uintptr_t)name, mode, length};
    return chip_call(0x01U, arguments);
}

/* Bytes that were not read. */
static inline uint32_t chip_read(uint32_t file, void *to, uint32_t bytes)
{
    const uint32_t arguments[3] = {file, (uint32_t)(uintptr_t)to, bytes};
    return chip_call(0x06U, arguments);
}

static inline void chip_write(uint32_t file, const void *from, uint32_t bytes)
{
    const uint32_t arguments[3] = {file, (uint32_t)(uintptr_t)from, bytes};
    if (chip_call(0x05U, arguments) != 0U) {
        chip_exit(false);
    }
}

void chip_reset(void)
{
    uint32_t *word;
    const uint32_t *image = chip_data_image;
#if defined(__ARM_FP)
    *(volatile uint32_t *)0xE000ED88U |= 0x00F00000U;
    __asm__ volatile("dsb\nisb");
#elif defined(__riscv_flen)
    __asm__ volatile("li t0, 0x2000\ncsrs mstatus, t0\ncsrw fcsr, x0" ::: "t0");
#endif
    for (word = chip_data_start; word < chip_data_end; word++) {
        *word = *image;
        image++;
    }
    for (word = chip_bss_start; word < chip_bss_end; word++) {
        *word = 0U;
    }
    chip_counter();
    chip_exit(chip_main() == 0);
}
