/*
 * fmi3_absent.h: functions of FMI 3.0 for what this FMU does not have, the second part of fmi3.c. Each refuses with a reason.
 * Free for any use: SPDX-License-Identifier: 0BSD
 */

/* A getter and a setter of a type that no variable has. */
#define FMU_NO_VALUES(name, type)                                                                                                  \
    fmi3Status FMU_NAME(Get##name)(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,     \
        type values[], size_t nValues)                                                                                             \
    {                                                                                                                              \
        (void)valueReferences;                                                                                                     \
        (void)values;                                                                                                              \
        return fmu_no_values(instance, nValueReferences, nValues);                                                                 \
    }                                                                                                                              \
    fmi3Status FMU_NAME(Set##name)(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,     \
        const type values[], size_t nValues)                                                                                       \
    {                                                                                                                              \
        (void)valueReferences;                                                                                                     \
        (void)values;                                                                                                              \
        return fmu_no_values(instance, nValueReferences, nValues);                                                                 \
    }

static fmi3Status fmu_no_values(fmi3Instance instance, size_t references, size_t values)
{
    const bool is_empty = (references == 0U) && (values == 0U);
    return is_empty ? fmi3OK : fmu_absent(instance, "no variable has this type");
}

FMU_NO_VALUES(Float32, fmi3Float32)
FMU_NO_VALUES(Int8, fmi3Int8)
FMU_NO_VALUES(UInt8, fmi3UInt8)
FMU_NO_VALUES(Int16, fmi3Int16)
FMU_NO_VALUES(UInt16, fmi3UInt16)
FMU_NO_VALUES(UInt32, fmi3UInt32)
FMU_NO_VALUES(UInt64, fmi3UInt64)
FMU_NO_VALUES(String, fmi3String)

fmi3Status FMU_NAME(GetBinary)(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    (void)valueReferences;
    (void)valueSizes;
    (void)values;
    return fmu_no_values(instance, nValueReferences, nValues);
}

fmi3Status FMU_NAME(SetBinary)(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)valueReferences;
    (void)valueSizes;
    (void)values;
    return fmu_no_values(instance, nValueReferences, nValues);
}

fmi3Status FMU_NAME(GetClock)(
    fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Clock values[])
{
    (void)valueReferences;
    (void)values;
    return fmu_no_values(instance, nValueReferences, 0U);
}

fmi3Status FMU_NAME(SetClock)(
    fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Clock values[])
{
    (void)valueReferences;
    (void)values;
    return fmu_no_values(instance, nValueReferences, 0U);
}

#define FMU_NOT_HERE "this FMU has no such capability: see modelDescription.xml"

fmi3Status FMU_NAME(EnterEventMode)(fmi3Instance instance)
{
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(EnterStepMode)(fmi3Instance instance)
{
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(EnterConfigurationMode)(fmi3Instance instance)
{
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(ExitConfigurationMode)(fmi3Instance instance)
{
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(EvaluateDiscreteStates)(fmi3Instance instance)
{
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(UpdateDiscreteStates)(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
{
    (void)discreteStatesNeedUpdate;
    (void)terminateSimulation;
    (void)nominalsOfContinuousStatesChanged;
    (void)valuesOfContinuousStatesChanged;
    (void)nextEventTimeDefined;
    (void)nextEventTime;
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(GetNumberOfVariableDependencies)(
    fmi3Instance instance, fmi3ValueReference valueReference, size_t *nDependencies)
{
    (void)valueReference;
    (void)nDependencies;
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(GetVariableDependencies)(fmi3Instance instance, fmi3ValueReference dependent,
    size_t elementIndicesOfDependent[], fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
    fmi3DependencyKind dependencyKinds[], size_t nDependencies)
{
    (void)dependent;
    (void)elementIndicesOfDependent;
    (void)independents;
    (void)elementIndicesOfIndependents;
    (void)dependencyKinds;
    (void)nDependencies;
    return fmu_absent(instance, FMU_NOT_HERE);
}

/* Derivatives. */
#define FMU_NO_DERIVATIVES(name)                                                                                                   \
    fmi3Status FMU_NAME(name)(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,                        \
        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[],      \
        size_t nSensitivity)                                                                                                       \
    {                                                                                                                              \
        (void)unknowns;                                                                                                            \
        (void)nUnknowns;                                                                                                           \
        (void)knowns;                                                                                                              \
        (void)nKnowns;                                                                                                             \
        (void)seed;                                                                                                                \
        (void)nSeed;                                                                                                               \
        (void)sensitivity;                                                                                                         \
        (void)nSensitivity;                                                                                                        \
        return fmu_absent(instance, FMU_NOT_HERE);                                                                                 \
    }

FMU_NO_DERIVATIVES(GetDirectionalDerivative)
FMU_NO_DERIVATIVES(GetAdjointDerivative)

fmi3Status FMU_NAME(GetOutputDerivatives)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
{
    (void)valueReferences;
    (void)orders;
    (void)values;
    return fmu_no_values(instance, nValueReferences, nValues);
}

/* Functions of clocks. */
#define FMU_NO_CLOCKS(name, ...)                                                                                                   \
    fmi3Status FMU_NAME(name)(                                                                                                     \
        fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, __VA_ARGS__)                   \
    {                                                                                                                              \
        (void)valueReferences;                                                                                                     \
        FMU_UNUSED;                                                                                                                \
        return fmu_no_values(instance, nValueReferences, 0U);                                                                      \
    }

#define FMU_UNUSED (void)a, (void)b
FMU_NO_CLOCKS(GetIntervalDecimal, fmi3Float64 a[], fmi3IntervalQualifier b[])
FMU_NO_CLOCKS(GetShiftFraction, fmi3UInt64 a[], fmi3UInt64 b[])
FMU_NO_CLOCKS(SetIntervalFraction, const fmi3UInt64 a[], const fmi3UInt64 b[])
FMU_NO_CLOCKS(SetShiftFraction, const fmi3UInt64 a[], const fmi3UInt64 b[])
#undef FMU_UNUSED
#define FMU_UNUSED (void)a, (void)b, (void)c
FMU_NO_CLOCKS(GetIntervalFraction, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier c[])
#undef FMU_UNUSED
#define FMU_UNUSED (void)a
FMU_NO_CLOCKS(GetShiftDecimal, fmi3Float64 a[])
FMU_NO_CLOCKS(SetIntervalDecimal, const fmi3Float64 a[])
FMU_NO_CLOCKS(SetShiftDecimal, const fmi3Float64 a[])

/* ---- Model exchange and scheduled execution: importers look all functions up, whatever the FMU is for. */

fmi3Status FMU_NAME(EnterContinuousTimeMode)(fmi3Instance instance)
{
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(CompletedIntegratorStep)(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
    fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    (void)enterEventMode;
    (void)terminateSimulation;
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(SetTime)(fmi3Instance instance, fmi3Float64 time)
{
    (void)time;
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(SetContinuousStates)(fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates)
{
    (void)continuousStates;
    (void)nContinuousStates;
    return fmu_absent(instance, FMU_NOT_HERE);
}

/* Values of continuous states and events. */
#define FMU_NO_STATES(name)                                                                                                        \
    fmi3Status FMU_NAME(name)(fmi3Instance instance, fmi3Float64 values[], size_t count)                                           \
    {                                                                                                                              \
        (void)values;                                                                                                              \
        (void)count;                                                                                                               \
        return fmu_absent(instance, FMU_NOT_HERE);                                                                                 \
    }

FMU_NO_STATES(GetContinuousStateDerivatives)
FMU_NO_STATES(GetEventIndicators)
FMU_NO_STATES(GetContinuousStates)
FMU_NO_STATES(GetNominalsOfContinuousStates)

fmi3Status FMU_NAME(GetNumberOfEventIndicators)(fmi3Instance instance, size_t *nEventIndicators)
{
    (void)nEventIndicators;
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(GetNumberOfContinuousStates)(fmi3Instance instance, size_t *nContinuousStates)
{
    (void)nContinuousStates;
    return fmu_absent(instance, FMU_NOT_HERE);
}

fmi3Status FMU_NAME(ActivateModelPartition)(
    fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime)
{
    (void)clockReference;
    (void)activationTime;
    return fmu_absent(instance, FMU_NOT_HERE);
}
