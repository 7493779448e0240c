/* Replaces Simulink: calls a block's functions in its order, along the rows of a job on standard input.
 * Arguments: the two dialog parameters. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A row as tests/it/job.rs writes it. */
typedef struct {
    float a;
    float b;
    float sample;
    uint32_t age; /* UINT32_MAX without a sample */
    uint32_t flags;
} stub_row;

static int stub_fails(const char *why)
{
    (void)fprintf(stderr, "%s\n", why);
    return 1;
}

static uint32_t stub_bits(real_T value)
{
    const float single = (float)value;
    uint32_t bits;
    memcpy(&bits, &single, sizeof bits);
    return bits;
}

/* What the block has set of itself. */
static const char *stub_check(const SimStruct *S)
{
    int_T k;
    for (k = 0; k < S->inputs; k++) {
        const stub_port *port = &S->input[k];
        if ((port->width != 1) || (port->type != SS_DOUBLE) || (port->contiguous != 1) || (port->feedthrough != 1)) {
            return "an input port is not as it should be";
        }
    }
    for (k = 0; k < S->outputs; k++) {
        if ((S->output[k].width != 1) || (S->output[k].type != SS_DOUBLE)) {
            return "an output port is not as it should be";
        }
    }
    for (k = 0; k < S->dworks; k++) {
        if ((S->dwork[k].width <= 0) || (S->dwork[k].type != SS_UINT32) || (S->dwork[k].name == NULL)) {
            return "a DWork vector is not as it should be";
        }
    }
    if ((S->continuous != 0) || (S->discrete != 0) || (S->times != 1) || (S->outputs != 4) || (S->dworks != 2)) {
        return "states, sample times, outputs or DWork vectors are not as many as there should be";
    }
    return NULL;
}

int main(int count, char **arguments)
{
    static SimStruct block;
    SimStruct *S = &block;
    mxArray parameters[STUB_PARAMETERS];
    stub_row row;
    size_t bytes;
    void *before;
    int_T k;

    S->parameters_given = count - 1;
    for (k = 0; (k < STUB_PARAMETERS) && (k < (count - 1)); k++) {
        parameters[k].value = atof(arguments[k + 1]);
        parameters[k].elements = 1;
        parameters[k].is_double = 1;
        parameters[k].is_complex = 0;
        S->parameters[k] = &parameters[k];
    }
    mdlInitializeSizes(S);
    if (S->parameters_wanted != S->parameters_given) {
        return stub_fails("the number of parameters is another one");
    }
    if (S->error != NULL) {
        return stub_fails(S->error);
    }
    mdlInitializeSampleTimes(S);
    if (stub_check(S) != NULL) {
        return stub_fails(stub_check(S));
    }
    bytes = (size_t)S->dwork[0].width * sizeof(uint32_t);
    before = malloc(bytes);
    for (k = 0; k < S->dworks; k++) {
        S->dwork[k].data = malloc(bytes);
        if ((before == NULL) || (S->dwork[k].data == NULL)) {
            return stub_fails("no memory");
        }
        memset(S->dwork[k].data, 0xa5, bytes);
    }
    (void)fprintf(stderr, "%d inputs every %.17g s from %g s\n", S->inputs, S->sample_time, S->offset_time);
    mdlInitializeConditions(S);
    while (fread(&row, sizeof row, 1U, stdin) == 1U) {
        const real_T sample = (row.age == UINT32_MAX) ? (real_T)NAN : (real_T)row.sample;
        uint32_t out[6] = {0U, 0U, 0U, 0U, 0U, 0U};
        int_T again;
        S->input[0].signal = (real_T)row.a;
        /* The sample in front of the applied voltage, which is given where it is not what was commanded. */
        S->input[1].signal = sample;
        S->input[3].signal = ((row.flags & 16384U) != 0U) ? (real_T)(20.0F + (3000.0F * row.a)) : (real_T)NAN;
        S->input[2].signal = ((row.flags & 4U) != 0U) ? (0.5 * S->output[1].signal) : (real_T)NAN;
        if (parameters[0].value == 4.0) {
            S->input[1].signal = S->input[2].signal;
        }
        memcpy(before, S->dwork[0].data, bytes);
        for (again = 0; again < 2; again++) {
            /* Simulink may ask several times, and then with other inputs first. */
            const real_T first = S->input[0].signal;
            if (again == 0) {
                S->input[0].signal = 0.5 * first;
            }
            mdlOutputs(S, 0);
            S->input[0].signal = first;
        }
        if (memcmp(before, S->dwork[0].data, bytes) != 0) {
            return stub_fails("mdlOutputs has changed the state");
        }
        mdlUpdate(S, 0);
        if (S->error != NULL) {
            return stub_fails(S->error);
        }
        for (k = 0; k < 3; k++) {
            out[k] = stub_bits(S->output[k].signal);
        }
        out[5] = (uint32_t)S->output[3].signal;
        (void)fwrite(out, sizeof out, 1U, stdout);
    }
    mdlTerminate(S);
    for (k = 0; k < S->dworks; k++) {
        free(S->dwork[k].data);
    }
    free(before);
    return 0;
}
