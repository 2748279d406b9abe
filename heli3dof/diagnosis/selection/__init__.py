"""Forward selection and backward elimination of causes by full fits."""
