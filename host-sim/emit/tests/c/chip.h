/* A bare chip in QEMU: start, files of the host by semihosting, and a counter of instructions under -icount shift=0. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

int chip_main(void);

#if defined(__riscv)

/* The three instructions that a debugger looks for, which must be uncompressed and on one page. */
uint32_t chip_call(uint32_t operation, const void *arguments);
__asm__(".section .text.chip_call, \"ax\"\n.option push\n.option norvc\n.option norelax\n.balign 16\n"
        ".globl chip_call\nchip_call:\nslli x0, x0, 0x1f\nebreak\nsrai x0, x0, 7\nret\n.option pop\n.text");

/* A moment, and the instructions between two of them. */
static inline uint32_t chip_moment(void)
{
    uint32_t count;
    __asm__ volatile(".option push\n.option arch, +zicsr\ncsrr %0, minstret\n.option pop" : "=r"(count));
    return count;
}

static inline uint32_t chip_between(uint32_t start, uint32_t end)
{
    return end - start;
}

static inline void chip_counter(void)
{
}

void chip_reset(void);
__asm__(".section .start, \"ax\"\n.globl _start\n_start:\nla sp, chip_stack_top\nj chip_reset\n.text");

#else

static inline uint32_t chip_call(uint32_t operation, const void *arguments)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = arguments;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* A moment: SysTick counts periods of the core's clock down, a nanosecond being an instruction. At most 2^24 periods lie between two. */
static inline uint32_t chip_moment(void)
{
    return *(volatile uint32_t *)0xE000E018U;
}

static inline uint32_t chip_between(uint32_t start, uint32_t end)
{
    return (uint32_t)(((uint64_t)((start - end) & 0x00FFFFFFU) * 1000U) / CHIP_MHZ);
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
