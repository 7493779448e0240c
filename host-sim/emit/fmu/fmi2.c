/*
 * fmi2.c: the functions of FMI 2.0 for co-simulation in front of springpot_fmu.h.
 * Free for any use: SPDX-License-Identifier: 0BSD
 *
 * Types of functions are those of the standard's headers, so that a wrong signature does not compile. With FMI2_FUNCTION_PREFIX their
 * names begin with it, for programs that link several FMUs.
 */
#include "fmi2FunctionTypes.h"
#include "springpot_fmu.h"

#ifndef FMI2_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX
#endif
#define FMU_JOINED(prefix, name) prefix##name
#define FMU_JOIN(prefix, name) FMU_JOINED(prefix, name)
#define FMU_NAME(name) FMU_JOIN(FMI2_FUNCTION_PREFIX, fmi2##name)
#if defined(_WIN32) || defined(__CYGWIN__)
#define FMU_EXPORT(name) __declspec(dllexport) fmi2##name##TYPE FMU_NAME(name)
#elif defined(__GNUC__)
#define FMU_EXPORT(name) __attribute__((visibility("default"))) fmi2##name##TYPE FMU_NAME(name)
#else
#define FMU_EXPORT(name) fmi2##name##TYPE FMU_NAME(name)
#endif

FMU_EXPORT(GetTypesPlatform);
FMU_EXPORT(GetVersion);
FMU_EXPORT(SetDebugLogging);
FMU_EXPORT(Instantiate);
FMU_EXPORT(FreeInstance);
FMU_EXPORT(SetupExperiment);
FMU_EXPORT(EnterInitializationMode);
FMU_EXPORT(ExitInitializationMode);
FMU_EXPORT(Terminate);
FMU_EXPORT(Reset);
FMU_EXPORT(GetReal);
FMU_EXPORT(GetInteger);
FMU_EXPORT(GetBoolean);
FMU_EXPORT(GetString);
FMU_EXPORT(SetReal);
FMU_EXPORT(SetInteger);
FMU_EXPORT(SetBoolean);
FMU_EXPORT(SetString);
FMU_EXPORT(GetFMUstate);
FMU_EXPORT(SetFMUstate);
FMU_EXPORT(FreeFMUstate);
FMU_EXPORT(SerializedFMUstateSize);
FMU_EXPORT(SerializeFMUstate);
FMU_EXPORT(DeSerializeFMUstate);
FMU_EXPORT(GetDirectionalDerivative);
FMU_EXPORT(SetRealInputDerivatives);
FMU_EXPORT(GetRealOutputDerivatives);
FMU_EXPORT(DoStep);
FMU_EXPORT(CancelStep);
FMU_EXPORT(GetStatus);
FMU_EXPORT(GetRealStatus);
FMU_EXPORT(GetIntegerStatus);
FMU_EXPORT(GetBooleanStatus);
FMU_EXPORT(GetStringStatus);

typedef struct {
    fmu_state state;
    fmi2CallbackLogger log;
    fmi2ComponentEnvironment environment;
    char *name;
} fmu_instance;

/* The status of `result`; what went wrong is logged, whatever is logged else. */
static fmi2Status fmu_logged(const fmu_instance *fmu, fmu_result result)
{
    if ((result.status != FMU_OK) && (fmu->log != NULL)) {
        const fmi2Status status = (fmi2Status)result.status;
        /* No text has a percent sign, so that each is its own format. */
        fmu->log(fmu->environment, fmu->name, status, (result.status == FMU_DISCARD) ? "logStatusDiscard" : "logStatusError",
            result.why);
    }
    return (fmi2Status)result.status;
}

/* For what this FMU does not have. */
static fmi2Status fmu_absent(fmi2Component c, const char *why)
{
    return fmu_logged((const fmu_instance *)c, fmu_error(why));
}

/* ---- Instances. */

const char *FMU_NAME(GetTypesPlatform)(void)
{
    return fmi2TypesPlatform;
}

const char *FMU_NAME(GetVersion)(void)
{
    return "2.0";
}

fmi2Status FMU_NAME(SetDebugLogging)(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[])
{
    (void)c;
    (void)loggingOn;
    (void)nCategories;
    (void)categories;
    return fmi2OK;
}

void FMU_NAME(FreeInstance)(fmi2Component c)
{
    fmu_instance *fmu = (fmu_instance *)c;
    if (fmu != NULL) {
        free(fmu->name);
        free(fmu);
    }
}

fmi2Component FMU_NAME(Instantiate)(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    fmu_instance *fmu = (fmu_instance *)malloc(sizeof *fmu);
    const char *name = (instanceName != NULL) ? instanceName : "";
    (void)fmuResourceLocation;
    (void)visible;
    (void)loggingOn;
    if (fmu == NULL) {
        return NULL;
    }
    fmu->log = (functions != NULL) ? functions->logger : NULL;
    fmu->environment = (functions != NULL) ? functions->componentEnvironment : NULL;
    fmu->name = (char *)malloc(strlen(name) + 1U);
    if (fmu->name == NULL) {
        free(fmu);
        return NULL;
    }
    memcpy(fmu->name, name, strlen(name) + 1U);
    fmu_start(&fmu->state);
    if ((fmuGUID == NULL) || (strcmp(fmuGUID, FMU_TOKEN) != 0)) {
        (void)fmu_absent(fmu, "the guid of modelDescription.xml is not that of this library");
    } else if (fmuType != fmi2CoSimulation) {
        (void)fmu_absent(fmu, "this FMU is for co-simulation");
    } else {
        return fmu;
    }
    FMU_NAME(FreeInstance)(fmu);
    return NULL;
}

fmi2Status FMU_NAME(SetupExperiment)(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
    fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    fmu_instance *fmu = (fmu_instance *)c;
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    if (fmu->state.phase != FMU_INSTANTIATED) {
        return fmu_absent(c, "the experiment is set up before initialisation");
    }
    fmu->state.start = startTime;
    return fmi2OK;
}

fmi2Status FMU_NAME(EnterInitializationMode)(fmi2Component c)
{
    fmu_instance *fmu = (fmu_instance *)c;
    return fmu_logged(fmu, fmu_initialise(&fmu->state, fmu->state.start));
}

fmi2Status FMU_NAME(ExitInitializationMode)(fmi2Component c)
{
    fmu_instance *fmu = (fmu_instance *)c;
    return fmu_logged(fmu, fmu_begin(&fmu->state));
}

fmi2Status FMU_NAME(Terminate)(fmi2Component c)
{
    fmu_instance *fmu = (fmu_instance *)c;
    return fmu_logged(fmu, fmu_terminate(&fmu->state));
}

fmi2Status FMU_NAME(Reset)(fmi2Component c)
{
    fmu_instance *fmu = (fmu_instance *)c;
    fmu_start(&fmu->state);
    return fmi2OK;
}

fmi2Status FMU_NAME(DoStep)(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
    fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    fmu_instance *fmu = (fmu_instance *)c;
    (void)currentCommunicationPoint;
    (void)noSetFMUStatePriorToCurrentPoint;
    return fmu_logged(fmu, fmu_step(&fmu->state, communicationStepSize));
}

/* ---- Values: an Integer is a whole number or the mode. */

fmi2Status FMU_NAME(GetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    fmu_instance *fmu = (fmu_instance *)c;
    fmu_result result = fmu_ok();
    size_t i;
    for (i = 0U; (i < nvr) && (result.status == FMU_OK); i++) {
        result = fmu_get_real(&fmu->state, vr[i], &value[i]);
    }
    return fmu_logged(fmu, result);
}

fmi2Status FMU_NAME(SetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    fmu_instance *fmu = (fmu_instance *)c;
    fmu_result result = fmu_ok();
    size_t i;
    for (i = 0U; (i < nvr) && (result.status == FMU_OK); i++) {
        result = fmu_set_real(&fmu->state, vr[i], value[i]);
    }
    return fmu_logged(fmu, result);
}

/* Gets or sets values of whole variables; `type` is that of all but the mode. */
static fmi2Status fmu_wholes(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, int type, int *get, const int *set)
{
    fmu_instance *fmu = (fmu_instance *)c;
    fmu_result result = fmu_ok();
    size_t i;
    for (i = 0U; (i < nvr) && (result.status == FMU_OK); i++) {
        const int own = ((type == FMU_WHOLE) && (vr[i] == FMU_MODE)) ? FMU_CHOICE : type;
        if (set != NULL) {
            const int64_t value = (type == FMU_FLAG) ? (int64_t)(set[i] != 0) : (int64_t)set[i];
            result = fmu_set_whole(&fmu->state, vr[i], own, value);
        } else {
            uint32_t whole = 0U;
            result = fmu_get_whole(&fmu->state, vr[i], own, &whole);
            if (result.status == FMU_OK) {
                get[i] = (int)whole;
            }
        }
    }
    return fmu_logged(fmu, result);
}

fmi2Status FMU_NAME(GetInteger)(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    return fmu_wholes(c, vr, nvr, FMU_WHOLE, value, NULL);
}

fmi2Status FMU_NAME(SetInteger)(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    return fmu_wholes(c, vr, nvr, FMU_WHOLE, NULL, value);
}

fmi2Status FMU_NAME(GetBoolean)(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    return fmu_wholes(c, vr, nvr, FMU_FLAG, value, NULL);
}

fmi2Status FMU_NAME(SetBoolean)(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    return fmu_wholes(c, vr, nvr, FMU_FLAG, NULL, value);
}

fmi2Status FMU_NAME(GetString)(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    (void)vr;
    (void)value;
    return (nvr == 0U) ? fmi2OK : fmu_absent(c, "no variable has this type");
}

fmi2Status FMU_NAME(SetString)(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    (void)vr;
    (void)value;
    return (nvr == 0U) ? fmi2OK : fmu_absent(c, "no variable has this type");
}

/* ---- States. */

fmi2Status FMU_NAME(GetFMUstate)(fmi2Component c, fmi2FMUstate *FMUstate)
{
    fmu_instance *fmu = (fmu_instance *)c;
    return fmu_logged(fmu, fmu_copy(&fmu->state, FMUstate));
}

fmi2Status FMU_NAME(SetFMUstate)(fmi2Component c, fmi2FMUstate FMUstate)
{
    fmu_instance *fmu = (fmu_instance *)c;
    return fmu_logged(fmu, fmu_restore(&fmu->state, FMUstate));
}

fmi2Status FMU_NAME(FreeFMUstate)(fmi2Component c, fmi2FMUstate *FMUstate)
{
    (void)c;
    if (FMUstate != NULL) {
        free(*FMUstate);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

fmi2Status FMU_NAME(SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    (void)c;
    (void)FMUstate;
    *size = FMU_SERIALIZED_BYTES;
    return fmi2OK;
}

fmi2Status FMU_NAME(SerializeFMUstate)(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    return fmu_logged((const fmu_instance *)c, fmu_serialize(FMUstate, (unsigned char *)serializedState, size));
}

fmi2Status FMU_NAME(DeSerializeFMUstate)(
    fmi2Component c, const fmi2Byte serializedState[], size_t size, fmi2FMUstate *FMUstate)
{
    return fmu_logged((const fmu_instance *)c, fmu_deserialize((const unsigned char *)serializedState, size, FMUstate));
}

/* ---- Statuses: a step is done when fmi2DoStep returns. */

fmi2Status FMU_NAME(CancelStep)(fmi2Component c)
{
    return fmu_absent(c, "no step is pending");
}

fmi2Status FMU_NAME(GetRealStatus)(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    const fmu_instance *fmu = (const fmu_instance *)c;
    fmi2Status status = fmi2Discard;
    if (s == fmi2LastSuccessfulTime) {
        *value = fmu_time(&fmu->state);
        status = fmi2OK;
    }
    return status;
}

fmi2Status FMU_NAME(GetBooleanStatus)(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    (void)c;
    *value = fmi2False;
    return (s == fmi2Terminated) ? fmi2OK : fmi2Discard;
}

fmi2Status FMU_NAME(GetStatus)(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    (void)c;
    (void)s;
    (void)value;
    return fmi2Discard;
}

fmi2Status FMU_NAME(GetIntegerStatus)(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    (void)c;
    (void)s;
    (void)value;
    return fmi2Discard;
}

fmi2Status FMU_NAME(GetStringStatus)(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    (void)c;
    (void)s;
    (void)value;
    return fmi2Discard;
}

/* ---- What modelDescription.xml does not promise: refused with a reason. */

#define FMU_NOT_HERE "this FMU has no such capability: see modelDescription.xml"

fmi2Status FMU_NAME(GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
    const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    (void)vUnknown_ref;
    (void)nUnknown;
    (void)vKnown_ref;
    (void)nKnown;
    (void)dvKnown;
    (void)dvUnknown;
    return fmu_absent(c, FMU_NOT_HERE);
}

fmi2Status FMU_NAME(SetRealInputDerivatives)(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr;
    (void)nvr;
    (void)order;
    (void)value;
    return fmu_absent(c, FMU_NOT_HERE);
}

fmi2Status FMU_NAME(GetRealOutputDerivatives)(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], fmi2Real value[])
{
    (void)vr;
    (void)nvr;
    (void)order;
    (void)value;
    return fmu_absent(c, FMU_NOT_HERE);
}
