"""Names that mean something in C already: keywords, macros, what libraries and compilers know."""

import re

WORDS = frozenset(
    """
    alignas alignof and and_eq arm asm auto bitand bitor bool break case catch char char16_t
    char32_t char8_t class co_await co_return co_yield compl complex concept const const_cast
    consteval constexpr constinit continue decltype default delete do double dynamic_cast else
    enum errno explicit export extern false far float for friend goto hpux i386 if imaginary
    inline int linux long main math_errhandling mips mutable namespace near new noexcept
    noreturn not not_eq nullptr operator or or_eq private protected public register
    reinterpret_cast requires restrict return short signed signgam sizeof sparc static
    static_assert static_cast stderr stdin stdout struct sun switch template this thread_local
    throw true try typedef typeid typename typeof typeof_unqual union unix unsigned using vax
    virtual void volatile wchar_t while xor xor_eq
    """.split()  # noqa: SIM905
)
"""Keywords of C and C++, those of compilers, and macros that are replaced wherever they stand."""

LIBRARY = frozenset(
    """
    abort abs acos acosh acospi aligned_alloc alloca asctime asin asinh asinpi assert
    at_quick_exit atan atan2 atan2pi atanh atanpi atexit atof atoi atol basename bcmp bcopy
    bsearch btowc bzero c16rtomb c32rtomb cabs cacos cacosh call_once calloc canonicalize carg
    casin casinh catan catanh cbrt ccos ccosh ceil cexp cimag clearerr clock clock_t clog clog10
    compoundn conj copysign cos cosh cospi cpow cproj creal csin csinh csqrt ctan ctanh ctime
    dadd dcgettext ddiv decodebin decodedec dfma dgettext difftime div div_t dmul double_t drem
    dsqrt dsub encodebin encodedec erf erfc execl execle execlp execv execve execvp exit exp
    exp10 exp10m1 exp2 exp2m1 explicit_bzero expm1 fabs fadd fclose fdim fdiv feclearexcept
    fegetenv fegetexceptflag fegetround feholdexcept fenv_t feof feraiseexcept ferror fesetenv
    fesetexceptflag fesetround fetestexcept feupdateenv fexcept_t fflush ffma ffs ffsimax fgetc
    fgetpos fgets fgetwc fgetws finite float_t floor fma fmax fmaximum fmaximum_mag
    fmaximum_mag_num fmaximum_num fmaxmag fmin fminimum fminimum_mag fminimum_mag_num
    fminimum_num fminmag fmod fmul fopen fork fpclassify fpos_t fprintf fprintf_unlocked fputc
    fputc_unlocked fputs fputs_unlocked fputwc fputws fread free free_aligned_sized free_sized
    freopen frexp fromfp fromfpx fscanf fseek fsetpos fsqrt fsub ftell fwide fwprintf fwrite
    fwrite_unlocked fwscanf gamma gamma_r getc getchar getenv getpayload gettext getwc getwchar
    gmtime gmtime_r hypot ilogb imaxabs imaxdiv index infinity isalnum isalpha isascii isblank
    iscanonical iscntrl isdigit iseqsig isfinite isgraph isgreater isgreaterequal isinf isless
    islessequal islessgreater islower isnan isnormal isprint ispunct issignaling isspace
    issubnormal isunordered isupper iswalnum iswalpha iswblank iswcntrl iswctype iswdigit
    iswgraph iswlower iswprint iswpunct iswspace iswupper iswxdigit isxdigit iszero j0 j1
    jmp_buf jn kill_dependency labs ldexp ldiv ldiv_t lgamma lgamma_r llabs lldiv lldiv_t llogb
    llquantexp llrint llround locale_t localeconv localtime localtime_r log log10 log10p1 log1p
    log2 log2p1 logb logp1 longjmp lrint lround malloc matherr max_align_t mblen mbrlen mbrtoc16
    mbrtoc32 mbrtowc mbsinit mbsrtowcs mbstate_t mbstowcs mbtowc memalignment memccpy memchr
    memcmp memcpy memfrob memmem memmove mempcpy memrchr memset memset_explicit mktime modf nan
    nearbyint nextafter nextdown nexttoward nextup nullptr_t offsetof once_flag perror
    posix_memalign pow pow10 pown powr printf printf_unlocked ptrdiff_t putc putc_unlocked
    putchar putchar_unlocked puts puts_unlocked putwc putwchar qsort quantize quantum quick_exit
    raise rand rawmemchr realloc reallocarray remainder remove remquo rename rewind rindex rint
    rootn round roundeven rsqrt samequantum scalb scalbln scalbn scanf setbuf setjmp setlocale
    setpayload setpayloadsig setvbuf sig_atomic_t sigabbrev_np sigdescr_np signal signbit
    significand sin sincos sinh sinpi size_t snprintf sprintf sqrt srand sscanf
    stdc_leading_zeros stpcpy stpncpy strcasecmp strcasecmp_l strcasestr strcat strchr strchrnul
    strcmp strcoll strcoll_l strcpy strcspn strdup strdupa strerror strerror_l strerror_r
    strerrordesc_np strerrorname_np strfmon strfromd strfromf strfroml strfry strftime strlcat
    strlcpy strlen strlwr strncasecmp strncasecmp_l strncat strncmp strncpy strndup strndupa
    strnlen strnstr strpbrk strrchr strsep strsignal strspn strstr strtod strtof strtoimax
    strtok strtok_r strtol strtold strtoul strtoumax strupr strverscmp strxfrm strxfrm_l
    swprintf swscanf system tan tanh tanpi tgamma time time_t timegm timespec_get
    timespec_getres tmpfile tmpnam toascii tolower totalorder totalordermag toupper towctrans
    towlower towupper trunc ufromfp ufromfpx ungetc ungetwc unreachable va_arg va_copy va_end
    va_list va_start vfprintf vfscanf vfwprintf vfwscanf vprintf vscanf vsnprintf vsprintf
    vsscanf vswprintf vswscanf vwprintf vwscanf wcrtomb wcscat wcschr wcscmp wcscoll wcscpy
    wcscspn wcsftime wcslen wcsncat wcsncmp wcsncpy wcspbrk wcsrchr wcsrtombs wcsspn wcsstr
    wcstod wcstof wcstoimax wcstok wcstol wcstold wcstombs wcstoul wcstoumax wcsxfrm wctob
    wctomb wctrans wctrans_t wctype wctype_t wint_t wmemchr wmemcmp wmemcpy wmemmove wmemset
    wprintf wscanf y0 y1 yn
    """.split()  # noqa: SIM905
)
"""Of the standard libraries of C99 to C23, and what compilers know beyond: those for doubles."""

_OTHERS = re.compile(
    r"u?_?u?int\w*_t|(atomic|pthread|thrd|mtx|cnd|tss)_\w+"
    r"|f(32|64)x?(add|sub|mul|div|fma|sqrt)\w*|\w+_[fiub](8|16|32|64)|((read|write)_)?controller_\w+"
)
"""Types of whole numbers, families of functions, helpers, and what an export offers."""

_PRECISION = re.compile(r"(f|l|[fd](16|32|64|128)x?)(?=_r$|$)")
"""What the names of functions for other types than doubles end with."""


def is_reserved(name: str) -> bool:
    """Whether no function, table or variable may be called so."""
    if name in WORDS or name in LIBRARY or _OTHERS.fullmatch(name):
        return True
    return _PRECISION.sub("", name) in LIBRARY
