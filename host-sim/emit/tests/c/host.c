/* Jobs from standard input to standard output. */
#include "job.h"

#include <stdio.h>

static bool job_read(void *to, uint32_t bytes)
{
    return fread(to, bytes, 1U, stdin) == 1U;
}

static void job_write(const void *from, uint32_t bytes)
{
    (void)fwrite(from, bytes, 1U, stdout);
}

int main(void)
{
    return job_all();
}
