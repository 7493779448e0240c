/*
 * fmi3.c: the functions of FMI 3.0 for co-simulation in front of springpot_fmu.h.
 * Free for any use: SPDX-License-Identifier: 0BSD
 *
 * With FMI3_FUNCTION_PREFIX the names of functions begin with it, for programs that link several FMUs.
 */
#include "springpot_fmu.h"

#if defined(FMI_STANDARD_HEADERS)
/* The standard's own headers, which declare all functions: a signature that differs does not compile. */
#include "fmi3Functions.h"
#else
/* What is used of the standard's types, so that an FMU needs no files of others. */
#define fmi3False false
typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef bool fmi3Clock;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef int fmi3DependencyKind;
typedef int fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
/* These are never called. */
typedef void (*fmi3ClockUpdateCallback)(void);
typedef void (*fmi3IntermediateUpdateCallback)(void);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif

#ifndef FMI3_FUNCTION_PREFIX
#define FMI3_FUNCTION_PREFIX
#endif
#define FMI(name) fmi3##name
#define FMI_PREFIX FMI3_FUNCTION_PREFIX
#define FMI_STATE FMUState
#define FMI_DESERIALIZE Deserialize
#define FMI_VERSION "3.0"
#define FMU_VALUES(type) const fmi3ValueReference references[], size_t count, type values[], size_t nValues
#define FMU_COUNT nValues

typedef struct {
    fmu_state state;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} fmu_instance;

/* The status of `result`; errors are logged whatever else is. */
static fmi3Status fmu_logged(const fmu_instance *fmu, fmu_result result)
{
    if ((result.status != FMU_OK) && (fmu->log != NULL)) {
        fmu->log(fmu->environment, (fmi3Status)result.status, "logStatusError", result.why);
    }
    return (fmi3Status)result.status;
}

#include "springpot_fmi.h"

FMU_FUNCTION(fmi3Instance, InstantiateCoSimulation)(fmi3String instanceName, fmi3String instantiationToken,
    fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3IntermediateUpdateCallback intermediateUpdate)
{
    fmu_instance *fmu = (fmu_instance *)malloc(sizeof *fmu);
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

FMU_FUNCTION(fmi3Instance, InstantiateModelExchange)(fmi3String instanceName, fmi3String instantiationToken,
    fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage)
{
    return NULL;
}

FMU_FUNCTION(fmi3Instance, InstantiateScheduledExecution)(fmi3String instanceName, fmi3String instantiationToken,
    fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
    fmi3UnlockPreemptionCallback unlockPreemption)
{
    return NULL;
}

FMU_FUNCTION(void, FreeInstance)(fmi3Instance instance)
{
    free(instance);
}

FMU_STATUS(EnterInitializationMode)(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
    fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_initialise(&fmu->state, startTime));
}

FMU_STATUS(DoStep)(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
    fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
    fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    const fmu_result result = fmu_step(&fmu->state, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = fmi3False;
    *lastSuccessfulTime = currentCommunicationPoint + ((result.status == FMU_OK) ? communicationStepSize : 0.0);
    return fmu_logged(fmu, result);
}

/* ---- Values: Float64, Int32, Boolean, and Int64 for the mode. */

FMU_REALS(Float64, fmi3Float64)
FMU_WHOLES(Int32, fmi3Int32, FMU_WHOLE, (fmi3Int32)whole, values[i])
FMU_WHOLES(Int64, fmi3Int64, FMU_CHOICE, (fmi3Int64)whole, values[i])
FMU_WHOLES(Boolean, fmi3Boolean, FMU_FLAG, whole != 0U, values[i])
FMU_NO_TYPE(Float32, fmi3Float32)
FMU_NO_TYPE(Int8, fmi3Int8)
FMU_NO_TYPE(UInt8, fmi3UInt8)
FMU_NO_TYPE(Int16, fmi3Int16)
FMU_NO_TYPE(UInt16, fmi3UInt16)
FMU_NO_TYPE(UInt32, fmi3UInt32)
FMU_NO_TYPE(UInt64, fmi3UInt64)
FMU_NO_TYPE(String, fmi3String)

/* ---- What modelDescription.xml does not promise. Importers look all functions up, whatever the FMU is for. */

#define FMU_REFERENCES fmi3Instance instance, const fmi3ValueReference references[], size_t count
/* A function of variables of a type that none has. */
#define FMU_NO_VALUES(name, parameters, values)                                                                                    \
    FMU_STATUS(name) parameters                                                                                                    \
    {                                                                                                                              \
        return fmu_no_values(instance, count, values);                                                                             \
    }

FMU_NO_VALUES(GetBinary, (FMU_REFERENCES, size_t sizes[], fmi3Binary values[], size_t nValues), nValues)
FMU_NO_VALUES(SetBinary, (FMU_REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t nValues), nValues)
FMU_NO_VALUES(GetClock, (FMU_REFERENCES, fmi3Clock values[]), 0U)
FMU_NO_VALUES(SetClock, (FMU_REFERENCES, const fmi3Clock values[]), 0U)
FMU_NO_VALUES(GetIntervalDecimal, (FMU_REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]), 0U)
FMU_NO_VALUES(GetIntervalFraction,
    (FMU_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]), 0U)
FMU_NO_VALUES(SetIntervalDecimal, (FMU_REFERENCES, const fmi3Float64 intervals[]), 0U)
FMU_NO_VALUES(SetIntervalFraction, (FMU_REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), 0U)
FMU_NO_VALUES(GetShiftDecimal, (FMU_REFERENCES, fmi3Float64 shifts[]), 0U)
FMU_NO_VALUES(GetShiftFraction, (FMU_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]), 0U)
FMU_NO_VALUES(SetShiftDecimal, (FMU_REFERENCES, const fmi3Float64 shifts[]), 0U)
FMU_NO_VALUES(SetShiftFraction, (FMU_REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), 0U)
FMU_NO_VALUES(GetOutputDerivatives, (FMU_REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues), nValues)

FMU_ABSENT(EnterEventMode, (fmi3Instance instance))
FMU_ABSENT(EnterStepMode, (fmi3Instance instance))
FMU_ABSENT(EnterConfigurationMode, (fmi3Instance instance))
FMU_ABSENT(ExitConfigurationMode, (fmi3Instance instance))
FMU_ABSENT(EnterContinuousTimeMode, (fmi3Instance instance))
FMU_ABSENT(EvaluateDiscreteStates, (fmi3Instance instance))
FMU_ABSENT(UpdateDiscreteStates,
    (fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate, fmi3Boolean *terminateSimulation,
        fmi3Boolean *nominalsOfContinuousStatesChanged, fmi3Boolean *valuesOfContinuousStatesChanged,
        fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime))
FMU_ABSENT(GetNumberOfVariableDependencies, (fmi3Instance instance, fmi3ValueReference reference, size_t *nDependencies))
FMU_ABSENT(GetVariableDependencies,
    (fmi3Instance instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
        size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[], size_t nDependencies))
#define FMU_DERIVATIVE                                                                                                             \
    (FMU_REFERENCES, const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,                    \
        fmi3Float64 sensitivity[], size_t nSensitivity)
FMU_ABSENT(GetDirectionalDerivative, FMU_DERIVATIVE)
FMU_ABSENT(GetAdjointDerivative, FMU_DERIVATIVE)
FMU_ABSENT(CompletedIntegratorStep,
    (fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode,
        fmi3Boolean *terminateSimulation))
FMU_ABSENT(SetTime, (fmi3Instance instance, fmi3Float64 time))
FMU_ABSENT(SetContinuousStates, (fmi3Instance instance, const fmi3Float64 states[], size_t count))
FMU_ABSENT(GetContinuousStates, (fmi3Instance instance, fmi3Float64 states[], size_t count))
FMU_ABSENT(GetContinuousStateDerivatives, (fmi3Instance instance, fmi3Float64 derivatives[], size_t count))
FMU_ABSENT(GetNominalsOfContinuousStates, (fmi3Instance instance, fmi3Float64 nominals[], size_t count))
FMU_ABSENT(GetEventIndicators, (fmi3Instance instance, fmi3Float64 indicators[], size_t count))
FMU_ABSENT(GetNumberOfEventIndicators, (fmi3Instance instance, size_t *count))
FMU_ABSENT(GetNumberOfContinuousStates, (fmi3Instance instance, size_t *count))
FMU_ABSENT(ActivateModelPartition, (fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime))
