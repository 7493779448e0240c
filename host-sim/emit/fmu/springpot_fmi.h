/*
 * springpot_fmi.h: what the functions of both versions of FMI share, for fmi2.c and fmi3.c.
 * Free for any use: SPDX-License-Identifier: 0BSD
 *
 * The file that includes it defines FMI(name), which puts the version in front of a name of the standard; FMI_PREFIX, which function names
 * begin with; FMI_STATE and FMI_DESERIALIZE, two words that the versions spell differently; FMI_VERSION; FMU_VALUES(type), the
 * parameters `references`, `count` and `values` of a getter, and FMU_COUNT, how many values it has; fmu_instance and fmu_logged.
 */
#ifndef SPRINGPOT_FMI_H
#define SPRINGPOT_FMI_H

/* The standard's signatures have parameters that this FMU does not need. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#if defined(_WIN32) || defined(__CYGWIN__)
#define FMU_VISIBLE __declspec(dllexport)
#elif defined(__GNUC__)
#define FMU_VISIBLE __attribute__((visibility("default")))
#else
#define FMU_VISIBLE
#endif

#define FMU_JOINED(first, second) first##second
#define FMU_JOIN(first, second) FMU_JOINED(first, second)
/* The head of a function of the standard. */
#define FMU_NAME(name) FMU_JOIN(FMI_PREFIX, FMI(name))
#define FMU_FUNCTION(result, name) FMU_VISIBLE result FMU_NAME(name)
#define FMU_STATUS(name) FMU_FUNCTION(FMI(Status), name)
#define FMU_STATE(before, after) FMU_STATUS(FMU_JOIN(before, FMU_JOIN(FMI_STATE, after)))

static FMI(Status) fmu_absent(void *instance, const char *why)
{
    return fmu_logged((const fmu_instance *)instance, fmu_error(why));
}

/* A function for what modelDescription.xml does not promise: it refuses with a reason. */
#define FMU_ABSENT(name, parameters)                                                                                               \
    FMU_STATUS(name) parameters                                                                                                    \
    {                                                                                                                              \
        return fmu_absent(instance, "this FMU has no such capability: see modelDescription.xml");                                  \
    }

/* Gets or sets real values. */
static FMI(Status) fmu_reals(
    void *instance, const FMI(ValueReference) references[], size_t count, size_t values, double *get, const double *set)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    fmu_result result = fmu_scalars(count, values);
    size_t i;
    for (i = 0U; (i < values) && (result.status == FMU_OK); i++) {
        result = (set != NULL) ? fmu_set_real(&fmu->state, references[i], set[i])
                               : fmu_get_real(&fmu->state, references[i], &get[i]);
    }
    return fmu_logged(fmu, result);
}

/* For types that no variable has. */
static FMI(Status) fmu_no_values(void *instance, size_t references, size_t values)
{
    const bool is_empty = (references == 0U) && (values == 0U);
    return is_empty ? FMI(OK) : fmu_absent(instance, "no variable has this type");
}

/* A getter and a setter: of real values; of whole values of this `kind`, where `put` is `whole` and `taken` is `values[i]` in the other's
 * type; of a type that no variable has. */
#define FMU_REALS(name, type)                                                                                                      \
    FMU_STATUS(Get##name)(void *instance, FMU_VALUES(type))                                                                        \
    {                                                                                                                              \
        return fmu_reals(instance, references, count, FMU_COUNT, values, NULL);                                                    \
    }                                                                                                                              \
    FMU_STATUS(Set##name)(void *instance, FMU_VALUES(const type))                                                                  \
    {                                                                                                                              \
        return fmu_reals(instance, references, count, FMU_COUNT, NULL, values);                                                    \
    }
#define FMU_WHOLES(name, type, kind, put, taken)                                                                                   \
    FMU_STATUS(Get##name)(void *instance, FMU_VALUES(type))                                                                        \
    {                                                                                                                              \
        fmu_instance *fmu = (fmu_instance *)instance;                                                                              \
        fmu_result result = fmu_scalars(count, FMU_COUNT);                                                                         \
        size_t i;                                                                                                                  \
        for (i = 0U; (i < FMU_COUNT) && (result.status == FMU_OK); i++) {                                                          \
            uint32_t whole = 0U;                                                                                                   \
            result = fmu_get_whole(&fmu->state, references[i], kind, &whole);                                                      \
            if (result.status == FMU_OK) {                                                                                         \
                values[i] = put;                                                                                                   \
            }                                                                                                                      \
        }                                                                                                                          \
        return fmu_logged(fmu, result);                                                                                            \
    }                                                                                                                              \
    FMU_STATUS(Set##name)(void *instance, FMU_VALUES(const type))                                                                  \
    {                                                                                                                              \
        fmu_instance *fmu = (fmu_instance *)instance;                                                                              \
        fmu_result result = fmu_scalars(count, FMU_COUNT);                                                                         \
        size_t i;                                                                                                                  \
        for (i = 0U; (i < FMU_COUNT) && (result.status == FMU_OK); i++) {                                                          \
            result = fmu_set_whole(&fmu->state, references[i], kind, (int64_t)taken);                                              \
        }                                                                                                                          \
        return fmu_logged(fmu, result);                                                                                            \
    }
#define FMU_NO_TYPE(name, type)                                                                                                    \
    FMU_STATUS(Get##name)(void *instance, FMU_VALUES(type))                                                                        \
    {                                                                                                                              \
        return fmu_no_values(instance, count, FMU_COUNT);                                                                          \
    }                                                                                                                              \
    FMU_STATUS(Set##name)(void *instance, FMU_VALUES(const type))                                                                  \
    {                                                                                                                              \
        return fmu_no_values(instance, count, FMU_COUNT);                                                                          \
    }

FMU_FUNCTION(const char *, GetVersion)(void)
{
    return FMI_VERSION;
}

FMU_STATUS(SetDebugLogging)(void *instance, FMI(Boolean) on, size_t count, const FMI(String) categories[])
{
    return FMI(OK);
}

FMU_STATUS(ExitInitializationMode)(void *instance)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_begin(&fmu->state));
}

FMU_STATUS(Terminate)(void *instance)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_terminate(&fmu->state));
}

FMU_STATUS(Reset)(void *instance)
{
    fmu_start(&((fmu_instance *)instance)->state);
    return FMI(OK);
}

FMU_STATE(Get, )(void *instance, void **copy)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_copy(&fmu->state, copy));
}

FMU_STATE(Set, )(void *instance, void *copy)
{
    fmu_instance *fmu = (fmu_instance *)instance;
    return fmu_logged(fmu, fmu_restore(&fmu->state, copy));
}

FMU_STATE(Free, )(void *instance, void **copy)
{
    if (copy != NULL) {
        free(*copy);
        *copy = NULL;
    }
    return FMI(OK);
}

FMU_STATE(Serialized, Size)(void *instance, void *copy, size_t *size)
{
    *size = FMU_SERIALIZED_BYTES;
    return FMI(OK);
}

FMU_STATE(Serialize, )(void *instance, void *copy, FMI(Byte) bytes[], size_t size)
{
    return fmu_logged((const fmu_instance *)instance, fmu_serialize(copy, (unsigned char *)bytes, size));
}

FMU_STATE(FMI_DESERIALIZE, )(void *instance, const FMI(Byte) bytes[], size_t size, void **copy)
{
    return fmu_logged((const fmu_instance *)instance, fmu_deserialize((const unsigned char *)bytes, size, copy));
}

#endif /* SPRINGPOT_FMI_H */
