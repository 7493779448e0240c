/* Jobs from the file "input" to the file "output" of the host. */
#include "chip.h"

#include "job.h"

static uint8_t in_buffer[4000];
static uint32_t in_at;
static uint32_t in_end;
static uint32_t in_file;
static uint8_t out_buffer[4008];
static uint32_t out_at;
static uint32_t out_file;

static bool job_read(void *to, uint32_t bytes)
{
    uint32_t done = 0U;
    while (done < bytes) {
        if (in_at == in_end) {
            in_at = 0U;
            in_end = (uint32_t)sizeof in_buffer - chip_read(in_file, in_buffer, (uint32_t)sizeof in_buffer);
            if (in_end == 0U) {
                return false;
            }
        }
        ((uint8_t *)to)[done] = in_buffer[in_at];
        in_at++;
        done++;
    }
    return true;
}

static void flush(void)
{
    chip_write(out_file, out_buffer, out_at);
    out_at = 0U;
}

static void job_write(const void *from, uint32_t bytes)
{
    if ((out_at + bytes) > (uint32_t)sizeof out_buffer) {
        flush();
    }
    memcpy(&out_buffer[out_at], from, bytes);
    out_at += bytes;
}

int chip_main(void)
{
    int result;
    in_file = chip_open("input", 5U, 1U);
    out_file = chip_open("output", 6U, 5U);
    result = job_all();
    flush();
    return result;
}
