/*
 * fmi3.c: the functions of FMI 3.0 for co-simulation in front of springpot_fmu.h.
 * Free for any use: SPDX-License-Identifier: 0BSD
 *
 * Types of functions are those of the standard's headers, so that a wrong signature does not compile. With FMI3_FUNCTION_PREFIX their
 * names begin with it, for programs that link several FMUs.
 */
#include "fmi3FunctionTypes.h"
#include "springpot_fmu.h"

#ifndef FMI3_FUNCTION_PREFIX
#define FMI3_FUNCTION_PREFIX
#endif
#define FMU_JOINED(prefix, name) prefix##name
#define FMU_JOIN(prefix, name) FMU_JOINED(prefix, name)
#define FMU_NAME(name) FMU_JOIN(FMI3_FUNCTION_PREFIX, fmi3##name)
#if defined(_WIN32) || defined(__CYGWIN__)
#define FMU_EXPORT(name) __declspec(dllexport) fmi3##name##TYPE FMU_NAME(name)
#elif defined(__GNUC__)
#define FMU_EXPORT(name) __attribute__((visibility("default"))) fmi3##name##TYPE FMU_NAME(name)
#else
#define FMU_EXPORT(name) fmi3##name##TYPE FMU_NAME(name)
#endif

FMU_EXPORT(GetVersion);
FMU_EXPORT(SetDebugLogging);
FMU_EXPORT(InstantiateModelExchange);
FMU_EXPORT(InstantiateCoSimulation);
FMU_EXPORT(InstantiateScheduledExecution);
FMU_EXPORT(FreeInstance);
FMU_EXPORT(EnterInitializationMode);
FMU_EXPORT(ExitInitializationMode);
FMU_EXPORT(EnterEventMode);
FMU_EXPORT(Terminate);
FMU_EXPORT(Reset);
FMU_EXPORT(GetFloat32);
FMU_EXPORT(GetFloat64);
FMU_EXPORT(GetInt8);
FMU_EXPORT(GetUInt8);
FMU_EXPORT(GetInt16);
FMU_EXPORT(GetUInt16);
FMU_EXPORT(GetInt32);
FMU_EXPORT(GetUInt32);
FMU_EXPORT(GetInt64);
FMU_EXPORT(GetUInt64);
FMU_EXPORT(GetBoolean);
FMU_EXPORT(GetString);
FMU_EXPORT(GetBinary);
FMU_EXPORT(GetClock);
FMU_EXPORT(SetFloat32);
FMU_EXPORT(SetFloat64);
FMU_EXPORT(SetInt8);
FMU_EXPORT(SetUInt8);
FMU_EXPORT(SetInt16);
FMU_EXPORT(SetUInt16);
FMU_EXPORT(SetInt32);
FMU_EXPORT(SetUInt32);
FMU_EXPORT(SetInt64);
FMU_EXPORT(SetUInt64);
FMU_EXPORT(SetBoolean);
FMU_EXPORT(SetString);
FMU_EXPORT(SetBinary);
FMU_EXPORT(SetClock);
FMU_EXPORT(GetNumberOfVariableDependencies);
FMU_EXPORT(GetVariableDependencies);
FMU_EXPORT(GetFMUState);
FMU_EXPORT(SetFMUState);
FMU_EXPORT(FreeFMUState);
FMU_EXPORT(SerializedFMUStateSize);
FMU_EXPORT(SerializeFMUState);
FMU_EXPORT(DeserializeFMUState);
FMU_EXPORT(GetDirectionalDerivative);
FMU_EXPORT(GetAdjointDerivative);
FMU_EXPORT(EnterConfigurationMode);
FMU_EXPORT(ExitConfigurationMode);
FMU_EXPORT(GetIntervalDecimal);
FMU_EXPORT(GetIntervalFraction);
FMU_EXPORT(GetShiftDecimal);
FMU_EXPORT(GetShiftFraction);
FMU_EXPORT(SetIntervalDecimal);
FMU_EXPORT(SetIntervalFraction);
FMU_EXPORT(SetShiftDecimal);
FMU_EXPORT(SetShiftFraction);
FMU_EXPORT(EvaluateDiscreteStates);
FMU_EXPORT(UpdateDiscreteStates);
FMU_EXPORT(EnterStepMode);
FMU_EXPORT(GetOutputDerivatives);
FMU_EXPORT(DoStep);
FMU_EXPORT(EnterContinuousTimeMode);
FMU_EXPORT(CompletedIntegratorStep);
FMU_EXPORT(SetTime);
FMU_EXPORT(SetContinuousStates);
FMU_EXPORT(GetContinuousStateDerivatives);
FMU_EXPORT(GetEventIndicators);
FMU_EXPORT(GetContinuousStates);
FMU_EXPORT(GetNominalsOfContinuousStates);
FMU_EXPORT(GetNumberOfEventIndicators);
FMU_EXPORT(GetNumberOfContinuousStates);
FMU_EXPORT(ActivateModelPartition);

typedef struct {
    fmu_state state;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} fmu_instance;

/* The status of `result`; what went wrong is logged, whatever is logged else. */
static fmi3Status fmu_logged(const fmu_instance *fmu, fmu_result result)
{
    if ((result.status != FMU_OK) && (fmu->log != NULL)) {
        const fmi3Status status = (fmi3Status)result.status;
        fmu->log(fmu->environment, status, (result.status == FMU_DISCARD) ? "logStatusDiscard" : "logStatusError", result.why);
    }
    return (fmi3Status)result.status;
}

/* For what this FMU does not have. */
static fmi3Status fmu_absent(fmi3Instance instance, const char *why)
{
    return fmu_logged((const fmu_instance *)instance, fmu_error(why));
}

/* ---- Instances. */

const char *FMU_NAME(GetVersion)(void)
{
    return "3.0";
}

fmi3Status FMU_NAME(SetDebugLogging)(
    fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String categories[])
{
    (void)instance;
    (void)loggingOn;
    (void)nCategories;
    (void)categories;
    return fmi3OK;
}

fmi3Instance FMU_NAME(InstantiateCoSimulation)(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
    const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables,
    fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3IntermediateUpdateCallback intermediateUpdate)
{
    fmu_instance *fmu = (fmu_instance *)malloc(sizeof *fmu);
    (void)instanceName;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables;
    (void)intermediateUpdate;
    if (fmu == NULL) {
        return NULL;
    }
    fmu->environment = instanceEnvironment;
    fmu->log = logMessage;
    fmu_start(&fmu->state);
    if ((instantiationToken == NULL) || (strcmp(instantiationToken, FMU_TOKEN) != 0)) {
        (void)fmu_absent(fmu, "the token of modelDescription.xml is not that of this library");
    } else if (eventModeUsed || (nRequiredIntermediateVariables != 0U)) {
        (void)fmu_absent(fmu, "there are no events and no intermediate variables");
    } else {
        return fmu;
    }
    free(fmu);
    return NULL;
}

fmi3Instance FMU_NAME(InstantiateModelExchange)(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage)
{
    (void)instanceName;
    (void)instantiationToken;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)instanceEnvironment;
    (void)logMessage;
    return NULL;
}

fmi3Instance FMU_NAME(InstantiateScheduledExecution)(fmi3String instanceName, fmi3String instantiationToken,
    fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
    fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)instanceName;
    (void)instantiationToken;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)instanceEnvironment;
    (void)logMessage;
    (void)clockUpdate;
    (void)lockPreemption;
    (void)unlockPreemption;
    return NULL;
}

void FMU_NAME(FreeInstance)(fmi3Instance instance)
{
    free(instance);
}

fmi3Status FMU_NAME(EnterInitializationMode)(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
    fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    return fmu_logged(fmu, fmu_initialise(&fmu->state, startTime));
}

fmi3Status FMU_NAME(ExitInitializationMode)(fmi3Instance instance)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_begin(&fmu->state));
}

fmi3Status FMU_NAME(Terminate)(fmi3Instance instance)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_terminate(&fmu->state));
}

fmi3Status FMU_NAME(Reset)(fmi3Instance instance)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    fmu_start(&fmu->state);
    return fmi3OK;
}

fmi3Status FMU_NAME(DoStep)(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
    fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
    fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    const fmu_result result = fmu_step(&fmu->state, communicationStepSize);
    (void)noSetFMUStatePriorToCurrentPoint;
    *eventHandlingNeeded = fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = fmi3False;
    *lastSuccessfulTime = currentCommunicationPoint + ((result.status == FMU_OK) ? communicationStepSize : 0.0);
    return fmu_logged(fmu, result);
}

/* ---- Values: Float64, Int32, Boolean, and Int64 for the mode. */

fmi3Status FMU_NAME(GetFloat64)(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    fmi3Float64 values[], size_t nValues)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    fmu_result result = (nValueReferences == nValues) ? fmu_ok() : fmu_error("as many values as references: all are scalars");
    size_t i;
    for (i = 0U; (i < nValues) && (result.status == FMU_OK); i++) {
        result = fmu_get_real(&fmu->state, valueReferences[i], &values[i]);
    }
    return fmu_logged(fmu, result);
}

fmi3Status FMU_NAME(SetFloat64)(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const fmi3Float64 values[], size_t nValues)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    fmu_result result = (nValueReferences == nValues) ? fmu_ok() : fmu_error("as many values as references: all are scalars");
    size_t i;
    for (i = 0U; (i < nValues) && (result.status == FMU_OK); i++) {
        result = fmu_set_real(&fmu->state, valueReferences[i], values[i]);
    }
    return fmu_logged(fmu, result);
}

/* A getter and a setter of whole values in the standard's type `type`. */
#define FMU_WHOLES(name, type, kind, put)                                                                                          \
    fmi3Status FMU_NAME(Get##name)(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,     \
        type values[], size_t nValues)                                                                                             \
    {                                                                                                                              \
        fmu_instance *fmu = (fmu_instance *)instance;                                                                              \
        fmu_result result =                                                                                                        \
            (nValueReferences == nValues) ? fmu_ok() : fmu_error("as many values as references: all are scalars");                 \
        size_t i;                                                                                                                  \
        for (i = 0U; (i < nValues) && (result.status == FMU_OK); i++) {                                                            \
            uint32_t whole = 0U;                                                                                                   \
            result = fmu_get_whole(&fmu->state, valueReferences[i], kind, &whole);                                                 \
            if (result.status == FMU_OK) {                                                                                         \
                values[i] = put;                                                                                                   \
            }                                                                                                                      \
        }                                                                                                                          \
        return fmu_logged(fmu, result);                                                                                            \
    }                                                                                                                              \
    fmi3Status FMU_NAME(Set##name)(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,     \
        const type values[], size_t nValues)                                                                                       \
    {                                                                                                                              \
        fmu_instance *fmu = (fmu_instance *)instance;                                                                              \
        fmu_result result =                                                                                                        \
            (nValueReferences == nValues) ? fmu_ok() : fmu_error("as many values as references: all are scalars");                 \
        size_t i;                                                                                                                  \
        for (i = 0U; (i < nValues) && (result.status == FMU_OK); i++) {                                                            \
            result = fmu_set_whole(&fmu->state, valueReferences[i], kind, (int64_t)values[i]);                                     \
        }                                                                                                                          \
        return fmu_logged(fmu, result);                                                                                            \
    }

FMU_WHOLES(Int32, fmi3Int32, FMU_WHOLE, (fmi3Int32)whole)
FMU_WHOLES(Int64, fmi3Int64, FMU_CHOICE, (fmi3Int64)whole)
FMU_WHOLES(Boolean, fmi3Boolean, FMU_FLAG, whole != 0U)

/* ---- States. */

fmi3Status FMU_NAME(GetFMUState)(fmi3Instance instance, fmi3FMUState *FMUState)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_copy(&fmu->state, FMUState));
}

fmi3Status FMU_NAME(SetFMUState)(fmi3Instance instance, fmi3FMUState FMUState)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_restore(&fmu->state, FMUState));
}

fmi3Status FMU_NAME(FreeFMUState)(fmi3Instance instance, fmi3FMUState *FMUState)
{
    (void)instance;
    if (FMUState != NULL) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

fmi3Status FMU_NAME(SerializedFMUStateSize)(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    (void)instance;
    (void)FMUState;
    *size = FMU_SERIALIZED_BYTES;
    return fmi3OK;
}

fmi3Status FMU_NAME(SerializeFMUState)(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size)
{
    return fmu_logged((const fmu_instance *)instance, fmu_serialize(FMUState, serializedState, size));
}

fmi3Status FMU_NAME(DeserializeFMUState)(
    fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState *FMUState)
{
    return fmu_logged((const fmu_instance *)instance, fmu_deserialize(serializedState, size, FMUState));
}

#include "fmi3_absent.h"
