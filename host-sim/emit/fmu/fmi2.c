/*
 * fmi2.c: the functions of FMI 2.0 for co-simulation in front of springpot_fmu.h.
 * Free for any use: SPDX-License-Identifier: 0BSD
 *
 * With FMI2_FUNCTION_PREFIX the names of functions begin with it, for programs that link several FMUs.
 */
#include "springpot_fmu.h"

#if defined(FMI_STANDARD_HEADERS)
/* The standard's own headers, which declare all functions: a signature that differs does not compile. */
#include "fmi2Functions.h"
#else
/* What is used of the standard's types, so that an FMU needs no files of others. */
#define fmi2TypesPlatform "default"
#define fmi2False 0
typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
typedef struct {
    fmi2CallbackLogger logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;
#endif

#ifndef FMI2_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX
#endif
#define FMI(name) fmi2##name
#define FMI_PREFIX FMI2_FUNCTION_PREFIX
#define FMI_STATE FMUstate
#define FMI_DESERIALIZE DeSerialize
#define FMI_VERSION "2.0"
#define FMU_VALUES(type) const fmi2ValueReference references[], size_t count, type values[]
#define FMU_COUNT count

typedef struct {
    fmu_state state;
    fmi2CallbackLogger log;
    fmi2ComponentEnvironment environment;
    char *name;
} fmu_instance;

/* The status of `result`; errors are logged whatever else is. */
static fmi2Status fmu_logged(const fmu_instance *fmu, fmu_result result)
{
    if ((result.status != FMU_OK) && (fmu->log != NULL)) {
        /* No text has a percent sign, so that each is its own format. */
        fmu->log(fmu->environment, fmu->name, (fmi2Status)result.status, "logStatusError", result.why);
    }
    return (fmi2Status)result.status;
}

#include "springpot_fmi.h"

FMU_FUNCTION(const char *, GetTypesPlatform)(void)
{
    return fmi2TypesPlatform;
}

FMU_FUNCTION(void, FreeInstance)(fmi2Component instance)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    if (fmu != NULL) {
        free(fmu->name);
        free(fmu);
    }
}

FMU_FUNCTION(fmi2Component, Instantiate)(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
    fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    fmu_instance *fmu = (fmu_instance *)malloc(sizeof *fmu);
    const char *name = (instanceName != NULL) ? instanceName : "";
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

FMU_STATUS(SetupExperiment)(fmi2Component instance, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
    fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    if (fmu->state.phase != FMU_INSTANTIATED) {
        return fmu_absent(instance, "the experiment is set up before initialisation");
    }
    fmu->state.start = startTime;
    return fmi2OK;
}

FMU_STATUS(EnterInitializationMode)(fmi2Component instance)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_initialise(&fmu->state, fmu->state.start));
}

FMU_STATUS(DoStep)(fmi2Component instance, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
    fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_step(&fmu->state, currentCommunicationPoint, communicationStepSize));
}

/* ---- Values: an Integer is a whole number or the mode. */

FMU_REALS(Real, fmi2Real)
FMU_WHOLES(Integer, fmi2Integer, (references[i] == FMU_MODE) ? FMU_CHOICE : FMU_WHOLE, (fmi2Integer)whole, values[i])
FMU_WHOLES(Boolean, fmi2Boolean, FMU_FLAG, (fmi2Boolean)whole, (values[i] != 0))
FMU_NO_TYPE(String, fmi2String)

/* ---- Statuses: a step is done when fmi2DoStep returns. */

FMU_STATUS(CancelStep)(fmi2Component instance)
{
    return fmu_absent(instance, "no step is pending");
}

FMU_STATUS(GetRealStatus)(fmi2Component instance, const fmi2StatusKind kind, fmi2Real *value)
{
    const fmu_instance *fmu = (const fmu_instance *)instance;
    fmi2Status status = fmi2Discard;
    if (kind == fmi2LastSuccessfulTime) {
        *value = fmu_time(&fmu->state);
        status = fmi2OK;
    }
    return status;
}

FMU_STATUS(GetBooleanStatus)(fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean *value)
{
    *value = fmi2False;
    return (kind == fmi2Terminated) ? fmi2OK : fmi2Discard;
}

/* A status that no FMU without pending steps has. */
#define FMU_NO_STATUS(name, type)                                                                                                  \
    FMU_STATUS(name)(fmi2Component instance, const fmi2StatusKind kind, type *value)                                               \
    {                                                                                                                              \
        return fmi2Discard;                                                                                                        \
    }

FMU_NO_STATUS(GetStatus, fmi2Status)
FMU_NO_STATUS(GetIntegerStatus, fmi2Integer)
FMU_NO_STATUS(GetStringStatus, fmi2String)

/* ---- What modelDescription.xml does not promise. */

FMU_ABSENT(GetDirectionalDerivative,
    (fmi2Component instance, const fmi2ValueReference unknowns[], size_t nUnknown, const fmi2ValueReference knowns[], size_t nKnown,
        const fmi2Real dvKnown[], fmi2Real dvUnknown[]))
FMU_ABSENT(SetRealInputDerivatives,
    (fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], const fmi2Real value[]))
FMU_ABSENT(GetRealOutputDerivatives,
    (fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], fmi2Real value[]))
