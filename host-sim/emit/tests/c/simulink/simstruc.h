/* What a Level-2 S-function uses of Simulink's header: declared as there, kept in a plain structure, so that tests/c/simulink/simulink.c
 * can replace Simulink. Written from the documented behaviour of each macro. */
#include <stddef.h>
#include <stdint.h>

typedef double real_T;
typedef int int_T;

/* A dialog parameter. */
typedef struct {
    real_T value;
    size_t elements;
    int_T is_double;
    int_T is_complex;
} mxArray;

#define mxIsDouble(array) ((array)->is_double)
#define mxIsComplex(array) ((array)->is_complex)
#define mxGetNumberOfElements(array) ((array)->elements)
#define mxGetScalar(array) ((array)->value)

enum { STUB_PORTS = 4, STUB_DWORK = 2, STUB_PARAMETERS = 2 };
enum { SS_DOUBLE = 0, SS_UINT32 = 7 };
enum { SS_PRM_NOT_TUNABLE = 0 };
enum { USE_DEFAULT_OPERATING_POINT = 1 };
#define SS_OPTION_EXCEPTION_FREE_CODE 1U

typedef struct {
    int_T width;
    int_T type;
    int_T contiguous;
    int_T feedthrough;
    real_T signal;
} stub_port;

typedef struct {
    int_T width;
    int_T type;
    const char *name;
    void *data;
} stub_dwork;

typedef struct {
    const char *error;
    int_T parameters_wanted;
    int_T parameters_given;
    const mxArray *parameters[STUB_PARAMETERS];
    int_T tunable[STUB_PARAMETERS];
    int_T continuous;
    int_T discrete;
    int_T inputs;
    int_T outputs;
    stub_port input[STUB_PORTS];
    stub_port output[STUB_PORTS];
    int_T dworks;
    stub_dwork dwork[STUB_DWORK];
    int_T times;
    real_T sample_time;
    real_T offset_time;
    int_T compliance;
    unsigned options;
    int_T may_write; /* mdlOutputs may not change DWork `kept` */
} SimStruct;

#define ssSetErrorStatus(S, text) ((S)->error = (text))
#define ssGetErrorStatus(S) ((S)->error)
#define ssSetNumSFcnParams(S, n) ((S)->parameters_wanted = (n))
#define ssGetNumSFcnParams(S) ((S)->parameters_wanted)
#define ssGetSFcnParamsCount(S) ((S)->parameters_given)
#define ssGetSFcnParam(S, k) ((S)->parameters[k])
#define ssSetSFcnParamTunable(S, k, value) ((S)->tunable[k] = (value))
#define ssSetNumContStates(S, n) ((S)->continuous = (n))
#define ssSetNumDiscStates(S, n) ((S)->discrete = (n))
#define ssSetNumInputPorts(S, n) ((S)->inputs = (n), (n) <= STUB_PORTS)
#define ssSetInputPortWidth(S, k, n) ((S)->input[k].width = (n))
#define ssSetInputPortDataType(S, k, t) ((S)->input[k].type = (t))
#define ssSetInputPortRequiredContiguous(S, k, is) ((S)->input[k].contiguous = (is))
#define ssSetInputPortDirectFeedThrough(S, k, is) ((S)->input[k].feedthrough = (is))
#define ssGetInputPortSignal(S, k) ((const void *)&(S)->input[k].signal)
#define ssSetNumOutputPorts(S, n) ((S)->outputs = (n), (n) <= STUB_PORTS)
#define ssSetOutputPortWidth(S, k, n) ((S)->output[k].width = (n))
#define ssSetOutputPortDataType(S, k, t) ((S)->output[k].type = (t))
#define ssGetOutputPortSignal(S, k) ((void *)&(S)->output[k].signal)
#define ssSetNumDWork(S, n) ((S)->dworks = (n), (n) <= STUB_DWORK)
#define ssSetDWorkWidth(S, k, n) ((S)->dwork[k].width = (n))
#define ssSetDWorkDataType(S, k, t) ((S)->dwork[k].type = (t))
#define ssSetDWorkName(S, k, text) ((S)->dwork[k].name = (text))
#define ssGetDWork(S, k) ((S)->dwork[k].data)
#define ssSetNumSampleTimes(S, n) ((S)->times = (n))
#define ssSetSampleTime(S, k, t) ((void)(k), (S)->sample_time = (t))
#define ssSetOffsetTime(S, k, t) ((void)(k), (S)->offset_time = (t))
#define ssSetOperatingPointCompliance(S, c) ((S)->compliance = (c))
#define ssSetOptions(S, o) ((S)->options = (o))
